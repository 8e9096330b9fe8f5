#include "smartmill_sim/controller/nc_block.h"

#include <cctype>

#include "controller/nc_reader.h"

namespace smartmill::sim {
namespace {

/// The line without blanks and comments, in upper case.
std::string significantText(const std::string& line) {
  std::string text;
  bool comment = false;
  for (const char c : line) {
    if (comment) {
      comment = c != ')';
    } else if (c == '(') {
      comment = true;
    } else if (!std::isspace(static_cast<unsigned char>(c)) && c != '\0') {
      text += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    }
  }
  if (comment) illegalAddress("(");
  return text;
}

void refuseRepeated(bool already, char address) {
  if (already) illegalAddress(std::string("TWICE ") + address);
}

template <class T>
void setWord(std::optional<T>& word, const std::optional<T>& content, char address) {
  refuseRepeated(word.has_value(), address);
  word = content;
}

void readGCode(int code, NcBlock& block, bool& dwell) {
  switch (code) {
    case 0:
    case 1:
    case 2:
    case 3:
      refuseRepeated(dwell, 'G');
      setWord<int>(block.motion, code, 'G');
      return;
    case 4:
      refuseRepeated(block.motion.has_value() || dwell, 'G');
      dwell = true;
      return;
    case 17:
      return;  // the only plane of arcs
    case 20:
    case 21:
      setWord<bool>(block.inch, code == 20, 'G');
      return;
    case 28:
      refuseRepeated(block.reference || block.machine, 'G');
      block.reference = true;
      return;
    case 53:
      refuseRepeated(block.reference || block.machine, 'G');
      block.machine = true;
      return;
    case 90:
    case 91:
      setWord<bool>(block.relative, code == 91, 'G');
      return;
    case 94:
    case 95:
      setWord<bool>(block.per_turn, code == 95, 'G');
      return;
    default:
      if (code >= 54 && code <= 59) {
        setWord<int>(block.work, code - 54, 'G');
        return;
      }
      throw NcAlarm(PS_IMPROPER_G, "IMPROPER G-CODE G" + std::to_string(code));
  }
}

void readMCode(int code, NcBlock& block) {
  refuseRepeated(block.m_code.has_value(), 'M');
  for (const int known : {0, 2, 3, 4, 5, 19, 30, 119}) {
    if (code == known) {
      block.m_code = code;
      return;
    }
  }
  illegalAddress("M" + std::to_string(code));
}

/// In G4 the words X (s) and P (ms) are times.
void readDwell(NcBlock& block, const std::optional<double>& milliseconds) {
  if (block.axis[1] || block.axis[2] || block.axis[0].has_value() == milliseconds.has_value())
    illegalAddress("IN G4");
  block.dwell = milliseconds ? *milliseconds * 1e-3 : *block.axis[0];
  block.axis[0].reset();
  if (*block.dwell < 0.0) illegalAddress("IN G4");
}

NcBlock parseAssignment(NcReader& reader) {
  NcBlock block;
  if (reader.accept("N")) block.sequence = reader.integer("N");
  reader.next();
  block.macro = reader.number("#");
  if (reader.next() != '=') throw NcAlarm(PS_MACRO_FORMAT, "ILLEGAL EXPRESSION FORMAT");
  block.macro_value = reader.expression();
  if (!reader.done()) throw NcAlarm(PS_MACRO_FORMAT, "ILLEGAL EXPRESSION FORMAT");
  return block;
}

/// Refuses control flow of macro programs, which this control does not support.
void refuseFlow(NcReader& reader) {
  for (const char* word : {"IF", "WHILE", "GOTO", "DO", "END", "THEN"}) {
    if (reader.accept(word)) throw NcAlarm(PS_MACRO_FORMAT, std::string(word) + " IS NOT KNOWN");
  }
}

void readWord(char address, NcReader& reader, NcBlock& block, bool& dwell,
              std::optional<double>& milliseconds) {
  const std::string name(1, address);
  switch (address) {
    case 'O':
    case ':':
      setWord(block.program, reader.integer(name), address);
      break;
    case 'N':
      setWord(block.sequence, reader.integer(name), address);
      break;
    case 'G':
      readGCode(reader.number(name), block, dwell);
      break;
    case 'X':
    case 'Y':
    case 'Z':
      setWord(block.axis[static_cast<std::size_t>(address - 'X')], reader.value(name), address);
      break;
    case 'I':
    case 'J':
      setWord(block.centre[static_cast<std::size_t>(address - 'I')], reader.value(name), address);
      break;
    case 'R':
      setWord(block.radius, reader.value(name), address);
      break;
    case 'P':
      setWord(milliseconds, reader.value(name), address);
      break;
    case 'F':
      setWord(block.feed, reader.value(name), address);
      break;
    case 'S':
      setWord(block.speed, reader.value(name), address);
      break;
    case 'M':
      readMCode(reader.number(name), block);
      break;
    default:
      illegalAddress(name);
  }
}

NcBlock parseWords(NcReader& reader) {
  NcBlock block;
  bool dwell = false;
  std::optional<double> milliseconds;
  while (!reader.done()) {
    refuseFlow(reader);
    readWord(reader.next(), reader, block, dwell, milliseconds);
  }
  if (dwell) {
    readDwell(block, milliseconds);
  } else if (milliseconds) {
    illegalAddress("P");
  }
  if ((block.feed && *block.feed < 0.0) || (block.speed && *block.speed < 0.0))
    illegalAddress(block.feed && *block.feed < 0.0 ? "F" : "S");
  return block;
}

}  // namespace

NcBlock parseBlock(const std::string& line, const NcVariables& variables) {
  const std::string text = significantText(line);
  if (text.empty() || text[0] == '%') return {};
  // A sequence number may precede an assignment.
  const std::size_t first = text[0] == 'N' ? text.find_first_not_of("0123456789", 1) : 0;
  NcReader reader(text, variables);
  return first != std::string::npos && text[first] == '#' && first != 1 ? parseAssignment(reader)
                                                                        : parseWords(reader);
}

}  // namespace smartmill::sim
