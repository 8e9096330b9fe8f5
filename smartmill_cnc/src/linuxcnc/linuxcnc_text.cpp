#include <sstream>

#include "smartmill_cnc/linuxcnc/linuxcnc_controller.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/nc/block_reader.h"
#include "smartmill_core/nc/orientation.h"

namespace smartmill::cnc::linuxcnc {
namespace {

constexpr const char* UNMARK = "M68 E0 Q0\n";
constexpr const char* STOP = "M5\nM66 P0 L3 Q30\n";  // waits for the input of standstill

std::string number(double value) {
  return formatted("%.4f", value);
}

/// Translates one block of the text of checkProgram().
std::string blockText(const std::string& line, std::size_t count) {
  nc::BlockReader reader(line, BRIDGE_DIALECT);
  std::string out, tail;
  bool dwell = false, moves = false;
  while (const std::optional<nc::Word> read = reader.next()) {
    const char letter = read->address;
    std::string word = read->text();
    dwell = dwell || word == "G4";
    if (dwell && (letter == 'P' || letter == 'X')) {
      word = "P" + number(letter == 'P' ? 1e-3 * *read->value : *read->value);
    } else if (word == "M5") {
      tail = std::string(UNMARK) + STOP;
      continue;
    } else if (word == "M119") {
      tail = std::string(UNMARK) + STOP + "M19 R[#" + std::to_string(nc::ORIENT_VARIABLE) + "*360/" +
             std::to_string(nc::ORIENT_STEPS) + "] Q20\n";
      continue;
    } else {
      moves = moves || (letter >= 'X' && letter <= 'Z');
    }
    out += (out.empty() ? "" : " ") + word;
  }
  const std::string mark = moves ? "M67 E0 Q" + std::to_string(count) + "\n" : "";
  return mark + (out.empty() ? "" : out + "\n") + tail;
}

}  // namespace

std::string linuxCncText(const std::string& program) {
  std::string text = "G21 G94 G61.1 M52 P1\n", line;
  std::istringstream lines(program);
  for (std::size_t count = 1; std::getline(lines, line); ++count) {
    text += line.empty() ? "" : line.front() == '#' ? line + "\n" : blockText(line, count);
  }
  return text + UNMARK;
}

}  // namespace smartmill::cnc::linuxcnc
