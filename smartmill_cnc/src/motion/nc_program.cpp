#include "smartmill_cnc/motion/nc_program.h"

#include <cmath>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "smartmill_core/formatted.h"
#include "smartmill_core/nc/block_reader.h"
#include "smartmill_core/nc/orientation.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

using nc::Word;

constexpr const char* AXES = "XYZ";
constexpr std::size_t MAX_BLOCK = 200;
constexpr double POSITION_TOLERANCE = 1e-9;  // [m] rounding of decimal input
constexpr int MAX_SEQUENCE = 99999, MAX_CODE = 999;

/// Exception for a block that must not be sent; converted to an NcCheck in this file.
struct Refusal {
  NcVerdict verdict;
  std::string message;
};

[[noreturn]] void refuse(NcVerdict verdict, std::size_t column, const std::string& message) {
  throw Refusal{verdict, "column " + std::to_string(column) + ": " + message};
}
[[noreturn]] void notUnderstood(const Word& word, const std::string& message) {
  refuse(NcVerdict::not_understood, word.column, message);
}
[[noreturn]] void outside(const Word& word, const std::string& message) {
  refuse(NcVerdict::outside_limits, word.column, message);
}

std::string numberText(double value) {
  return formatted("%.6g", value);
}

/// Interprets a program block by block and tracks its position.
class ProgramInterpreter {
 public:
  ProgramInterpreter(const StartPosition& start, const MotionLimits& limits, const DialectOptions& options)
      : limits_(limits), options_(options), position_(start.machine) {
    for (std::size_t i = 0; i < 3; ++i) {
      offset_[i] = start.machine[i] - start.absolute[i];
    }
    text_ = "G90\n";
  }

  void block(const std::string& line) {
    nc::BlockReader reader(line, BRIDGE_DIALECT);
    if (reader.text().empty()) {
      return;
    }
    if (ended_) {
      refuse(NcVerdict::not_understood, 1, "a block after the end of the program");
    }
    if (reader.text().size() > MAX_BLOCK) {
      refuse(NcVerdict::not_understood, 1,
             "block of " + std::to_string(reader.text().size()) + " characters, at most " +
                 std::to_string(MAX_BLOCK));
    }
    if (reader.assigns()) {
      assign(reader.assignment());
    } else {
      write(read(reader));
    }
  }

  const std::string& text() const { return text_; }
  const std::array<double, 3>& position() const { return position_; }

 private:
  struct Block {
    std::array<std::optional<Word>, 3> axis;
    std::optional<Word> sequence, dwell, dwell_p, feed, speed, m_code;
    std::string head;
  };

  void assign(const nc::Assignment& assignment) {
    if (assignment.variable == options_.marker_macro) {
      refuse(NcVerdict::not_understood, assignment.column,
             "#" + assignment.written_variable + " is the bridge's own variable");
    }
    text_ += "#" + assignment.written_variable + "=" + assignment.written_value + "\n";
  }

  Block read(nc::BlockReader& reader) {
    Block block;
    while (const std::optional<Word> word = reader.next()) {
      if (word->address == 'G') {
        gCode(*word, block);
        continue;
      }
      std::optional<Word>& place = placeOf(*word, block);
      if (place) {
        notUnderstood(*word, std::string("two words ") + word->address + " in one block");
      }
      place = word;
      if (word->address == 'N') {
        block.head = "N" + std::to_string(nc::integer(*word, MAX_SEQUENCE)) + " " + block.head;
      } else if (word->address == 'P' || word->address == 'M') {
        nc::integer(*word, word->address == 'M' ? MAX_CODE : nc::LARGEST_INTEGER);
      }
    }
    return block;
  }

  /// Of an address of BRIDGE_DIALECT other than G.
  static std::optional<Word>& placeOf(const Word& word, Block& block) {
    switch (word.address) {
      case 'N':
        return block.sequence;
      case 'P':
        return block.dwell_p;
      case 'F':
        return block.feed;
      case 'S':
        return block.speed;
      case 'M':
        return block.m_code;
      default:
        return block.axis[static_cast<std::size_t>(word.address - 'X')];
    }
  }

  void write(const Block& block) {
    std::string out = block.head;
    if (block.dwell) {
      out += dwellWords(block);
    } else if (block.dwell_p) {
      notUnderstood(*block.dwell_p, "P without G4");
    }
    if (block.feed) {
      out += feedWord(*block.feed);
    }
    if (block.speed) {
      out += speedWord(*block.speed);
    }
    if (!block.dwell) {
      out += move(block.axis);
    }
    if (block.m_code) {
      out += mCode(*block.m_code);
    }
    while (!out.empty() && out.back() == ' ') {
      out.pop_back();
    }
    if (!out.empty()) {
      text_ += out + "\n";
    }
  }

  void gCode(const Word& word, Block& block) {
    const int code = nc::integer(word, MAX_CODE);
    switch (code) {
      case 0:
      case 1:
        motion_ = code;
        break;
      case 4:
        block.dwell = word;
        break;
      case 90:
      case 91:
        relative_ = code == 91;
        break;
      default:
        notUnderstood(word, "unknown word " + word.text() + ", expected G0, G1, G4, G90 or G91");
    }
    block.head += "G" + std::to_string(code) + " ";
  }

  std::string dwellWords(const Block& block) const {
    const auto& [x, y, z] = block.axis;
    if (y || z || x.has_value() == block.dwell_p.has_value()) {
      notUnderstood(*block.dwell, "G4 needs P in ms or X in s, alone");
    }
    const Word& word = x ? *x : *block.dwell_p;
    const double seconds = x ? *x->value : 1e-3 * nc::integer(word);
    if (seconds < 0.0) {
      notUnderstood(word, "G4 with a negative time");
    }
    if (seconds > limits_.max_dwell) {
      outside(word,
              "dwell of " + numberText(seconds) + " s, at most " + numberText(limits_.max_dwell) + " s");
    }
    return x ? "X" + fixedDecimals(seconds, 3) + " " : "P" + std::to_string(nc::integer(word)) + " ";
  }

  std::string feedWord(const Word& word) {
    const double feed = *word.value;
    if (feed <= 0.0) {
      notUnderstood(word, "F" + numberText(feed) + ": expected a feed above 0");
    }
    const double most = limits_.max_feed / units::MM * 60.0;
    if (feed > most * (1.0 + 1e-9)) {
      outside(word, "F" + numberText(feed) + " mm/min, at most " + numberText(most) + " mm/min");
    }
    feed_known_ = true;
    return "F" + fixedDecimals(feed, options_.decimals) + " ";
  }

  std::string speedWord(const Word& word) const {
    const double speed = *word.value;
    if (speed < 0.0) {
      notUnderstood(word, "S" + numberText(speed) + ": expected a speed of 0 or more");
    }
    const double most = units::rpmFromRadPerSec(limits_.max_spindle_speed);
    if (speed > most * (1.0 + 1e-9)) {
      outside(word, "S" + numberText(speed) + " rpm, at most " + numberText(most) + " rpm");
    }
    return word.text() + " ";
  }

  std::string move(const std::array<std::optional<Word>, 3>& axis) {
    std::string out;
    for (std::size_t i = 0; i < 3; ++i) {
      if (axis[i]) {
        out += axisWord(i, *axis[i]);
      }
    }
    return out;
  }

  std::string axisWord(std::size_t axis, const Word& word) {
    if (motion_ < 0) {
      notUnderstood(word, "an axis word before G0 or G1");
    }
    if (motion_ == 1 && !feed_known_) {
      notUnderstood(word, "G1 before F");
    }
    const double length = *word.value * units::MM;
    double& position = position_[axis];
    position = relative_ ? position + length : length + offset_[axis];
    if (!std::isfinite(position)) {
      outside(word, std::string("the controller reports no position of ") + AXES[axis]);
    }
    const auto [low, high] = limits_.travel[axis];
    if (position < low - POSITION_TOLERANCE || position > high + POSITION_TOLERANCE) {
      outside(word, std::string(1, AXES[axis]) + " would go to " + numberText(position / units::MM) +
                        " mm, limits " + numberText(low / units::MM) + " to " + numberText(high / units::MM) +
                        " mm (machine)");
    }
    return AXES[axis] + fixedDecimals(*word.value, options_.decimals) + " ";
  }

  std::string mCode(const Word& word) {
    const int code = nc::integer(word, MAX_CODE);
    switch (code) {
      case 2:
      case 30:
        ended_ = true;
        return "M5";
      case 3:
      case 5:
      case 119:
        return "M" + std::to_string(code);
      default:
        notUnderstood(word, "unknown word " + word.text() + ", expected M2, M3, M5, M30 or M119");
    }
  }

  const MotionLimits& limits_;
  const DialectOptions& options_;
  std::array<double, 3> position_;  // [m] machine
  std::array<double, 3> offset_{{0, 0, 0}};
  bool relative_ = false;
  int motion_ = -1;  // 0 or 1 after G0 or G1
  bool feed_known_ = false;
  bool ended_ = false;
  std::string text_;
};

}  // namespace

NcCheck checkProgram(const std::string& program, const StartPosition& start, const MotionLimits& limits,
                     const DialectOptions& options) {
  NcCheck check;
  check.end = start.machine;
  ProgramInterpreter interpreter(start, limits, options);
  std::istringstream lines(program);
  std::string line;
  int count = 0;
  try {
    while (std::getline(lines, line)) {
      ++count;
      interpreter.block(line);
    }
  } catch (const nc::SyntaxError& error) {
    check.verdict = NcVerdict::not_understood;
    check.message = error.what();
  } catch (const Refusal& refusal) {
    check.verdict = refusal.verdict;
    check.message = refusal.message;
  }
  if (check.verdict != NcVerdict::good) {
    check.message = "line " + std::to_string(count) + ", " + check.message;
    return check;
  }
  check.text = interpreter.text();
  check.end = interpreter.position();
  return check;
}

std::string jogProgram(int axis, double distance, double feed, int decimals) {
  const std::string word = AXES[axis] + fixedDecimals(distance / units::MM, decimals);
  if (feed == 0.0) {
    return "G91 G0 " + word + "\n";
  }
  return "G91 G1 F" + fixedDecimals(feed / units::MM * 60.0, decimals) + " " + word + "\n";
}

std::string orientProgram(double angle, int macro) {
  const long steps = std::lround(std::fmod(angle, units::TWO_PI) / units::TWO_PI * nc::ORIENT_STEPS);
  return "#" + std::to_string(macro) + "=" +
         std::to_string((steps % nc::ORIENT_STEPS + nc::ORIENT_STEPS) % nc::ORIENT_STEPS) + "\nM119\n";
}

std::string fixedDecimals(double value, int decimals) {
  const std::string text = formatted("%.*f", decimals, value);
  const bool minus_zero = text[0] == '-' && text.find_first_not_of("-0.") == std::string::npos;
  return minus_zero ? text.substr(1) : text;
}

}  // namespace smartmill::cnc
