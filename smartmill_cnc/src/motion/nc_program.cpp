#include "smartmill_cnc/motion/nc_program.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

constexpr const char* AXES = "XYZ";
constexpr int ORIENT_STEPS = 4096;  // [1] per revolution
constexpr std::size_t MAX_BLOCK = 200;
constexpr double POSITION_TOLERANCE = 1e-9;  // [m] rounding of decimal input

struct Word {
  char letter;
  double value;
  std::string digits;
};

/// Exception for a block that must not be sent; converted to an NcCheck in this file.
struct Refusal {
  NcVerdict verdict;
  std::string message;
};

[[noreturn]] void notUnderstood(const std::string& message) {
  throw Refusal{NcVerdict::not_understood, message};
}
[[noreturn]] void outside(const std::string& message) {
  throw Refusal{NcVerdict::outside_limits, message};
}

std::string numberText(double value) {
  return formatted("%.6g", value);
}

std::string withoutComments(const std::string& line) {
  std::string text;
  bool comment = false;
  for (char c : line) {
    if (c == '(') {
      if (comment) {
        notUnderstood("comment within a comment");
      }
      comment = true;
    } else if (c == ')') {
      if (!comment) {
        notUnderstood("')' without '('");
      }
      comment = false;
    } else if (!comment && c != ' ' && c != '\t' && c != '\r') {
      text += static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
    }
  }
  if (comment) {
    notUnderstood("comment is not closed");
  }
  return text;
}

/// A number as a control reads it: digits with at most one point and a sign, no exponent.
std::string number(const std::string& text, std::size_t& at) {
  const std::size_t start = at;
  if (at < text.size() && (text[at] == '+' || text[at] == '-')) {
    ++at;
  }
  int digits = 0, points = 0;
  while (at < text.size() && ((text[at] >= '0' && text[at] <= '9') || text[at] == '.')) {
    (text[at] == '.' ? points : digits) += 1;
    ++at;
  }
  if (digits == 0 || points > 1 || digits > 12) {
    notUnderstood("'" + text.substr(start, std::max<std::size_t>(at - start, 1)) + "' is not a number");
  }
  return text.substr(start, at - start);
}

std::vector<Word> wordsOf(const std::string& text) {
  std::vector<Word> words;
  std::size_t at = 0;
  while (at < text.size()) {
    const char letter = text[at++];
    if (letter < 'A' || letter > 'Z') {
      notUnderstood("'" + text.substr(at - 1) + "' is not understood");
    }
    std::string digits = number(text, at);
    words.push_back({letter, std::strtod(digits.c_str(), nullptr), std::move(digits)});
  }
  return words;
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
    const std::string content = withoutComments(line);
    if (content.empty()) {
      return;
    }
    if (ended_) {
      notUnderstood("a block after the end of the program");
    }
    if (content.size() > MAX_BLOCK) {
      notUnderstood("block is longer than " + std::to_string(MAX_BLOCK) + " characters");
    }
    if (content[0] == '#') {
      assignment(content);
    } else {
      processWords(wordsOf(content));
    }
  }

  const std::string& text() const { return text_; }
  const std::array<double, 3>& position() const { return position_; }

 private:
  void assignment(const std::string& content) {
    const std::size_t equals = content.find('=');
    std::size_t at = 1;
    const std::string name = number(content, at);
    if (equals == std::string::npos || at != equals ||
        name.find_first_not_of("0123456789") != std::string::npos) {
      notUnderstood("'" + content + "' is not understood: expected #n=value");
    }
    ++at;
    const std::string value = number(content, at);
    if (at != content.size()) {
      notUnderstood("'" + content + "' is not understood: expected #n=value");
    }
    if (std::atoi(name.c_str()) == options_.marker_macro) {
      notUnderstood("#" + name + " is the bridge's own variable");
    }
    text_ += "#" + name + "=" + value + "\n";
  }

  struct Block {
    std::array<std::optional<double>, 3> axis;
    std::optional<double> dwell_p, feed, speed;
    std::optional<int> m_code;
    bool dwell = false;
    std::string head;
  };

  void processWords(const std::vector<Word>& words) {
    Block block;
    std::string letters;
    for (const Word& word : words) {
      if (word.letter != 'G') {
        if (letters.find(word.letter) != std::string::npos) {
          notUnderstood(std::string("two words ") + word.letter + " in one block");
        }
        letters += word.letter;
      }
      readWord(word, block);
    }
    write(block, words);
  }

  void readWord(const Word& word, Block& block) {
    switch (word.letter) {
      case 'N':
        block.head = "N" + std::to_string(wholeNumber(word, 99999)) + " " + block.head;
        break;
      case 'G':
        gCode(word, block.dwell, block.head);
        break;
      case 'X':
      case 'Y':
      case 'Z':
        block.axis[static_cast<std::size_t>(word.letter - 'X')] = word.value;
        break;
      case 'P':
        block.dwell_p = wholeNumber(word, 99999999);
        break;
      case 'F':
        block.feed = word.value;
        break;
      case 'S':
        block.speed = word.value;
        break;
      case 'M':
        block.m_code = wholeNumber(word, 999);
        break;
      default:
        notUnderstood(std::string("word ") + word.letter + word.digits + " is not understood");
    }
  }

  void write(const Block& block, const std::vector<Word>& words) {
    std::string out = block.head;
    if (block.dwell) {
      out += dwellWords(block.axis, block.dwell_p);
    } else if (block.dwell_p) {
      notUnderstood("P without G4");
    }
    if (block.feed) {
      out += feedWord(*block.feed);
    }
    if (block.speed) {
      out += speedWord(*block.speed, words);
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

  static int wholeNumber(const Word& word, int most) {
    if (word.value < 0.0 || word.value > most || word.value != std::floor(word.value)) {
      notUnderstood(std::string("word ") + word.letter + word.digits + ": expected an integer from 0 to " +
                    std::to_string(most));
    }
    return static_cast<int>(word.value);
  }

  void gCode(const Word& word, bool& dwell, std::string& head) {
    const int code = wholeNumber(word, 999);
    switch (code) {
      case 0:
      case 1:
        motion_ = code;
        break;
      case 4:
        dwell = true;
        break;
      case 90:
      case 91:
        relative_ = code == 91;
        break;
      default:
        notUnderstood("G" + std::to_string(code) + " is not understood");
    }
    head += "G" + std::to_string(code) + " ";
  }

  std::string dwellWords(const std::array<std::optional<double>, 3>& axis, std::optional<double> p) const {
    if (axis[1] || axis[2] || (axis[0].has_value() == p.has_value())) {
      notUnderstood("G4 needs P in ms or X in s, alone");
    }
    const double seconds = p ? *p * 1e-3 : *axis[0];
    if (seconds < 0.0) {
      notUnderstood("G4 with a negative time");
    }
    if (seconds > limits_.max_dwell) {
      outside("dwell of " + numberText(seconds) + " s, at most " + numberText(limits_.max_dwell) + " s");
    }
    return p ? "P" + std::to_string(static_cast<long>(*p)) + " " : "X" + fixedDecimals(*axis[0], 3) + " ";
  }

  std::string feedWord(double feed) {
    if (feed <= 0.0) {
      notUnderstood("F" + numberText(feed) + ": expected a feed above 0");
    }
    const double most = limits_.max_feed / units::MM * 60.0;
    if (feed > most * (1.0 + 1e-9)) {
      outside("F" + numberText(feed) + " mm/min, at most " + numberText(most) + " mm/min");
    }
    feed_known_ = true;
    return "F" + fixedDecimals(feed, options_.decimals) + " ";
  }

  std::string speedWord(double speed, const std::vector<Word>& words) const {
    if (speed < 0.0) {
      notUnderstood("S" + numberText(speed) + ": expected a speed of 0 or more");
    }
    const double most = units::rpmFromRadPerSec(limits_.max_spindle_speed);
    if (speed > most * (1.0 + 1e-9)) {
      outside("S" + numberText(speed) + " rpm, at most " + numberText(most) + " rpm");
    }
    const auto word = std::find_if(words.begin(), words.end(), [](const Word& w) { return w.letter == 'S'; });
    return "S" + word->digits + " ";
  }

  std::string move(const std::array<std::optional<double>, 3>& axis) {
    if (!axis[0] && !axis[1] && !axis[2]) {
      return {};
    }
    if (motion_ < 0) {
      notUnderstood("an axis word before G0 or G1");
    }
    if (motion_ == 1 && !feed_known_) {
      notUnderstood("G1 before F");
    }
    std::string out;
    for (std::size_t i = 0; i < 3; ++i) {
      if (!axis[i]) {
        continue;
      }
      const double length = *axis[i] * units::MM;
      position_[i] = relative_ ? position_[i] + length : length + offset_[i];
      if (!std::isfinite(position_[i])) {
        outside(std::string("the controller reports no position of ") + AXES[i]);
      }
      const std::array<double, 2>& travel = limits_.travel[i];
      if (position_[i] < travel[0] - POSITION_TOLERANCE || position_[i] > travel[1] + POSITION_TOLERANCE) {
        outside(std::string(1, AXES[i]) + " would go to " + numberText(position_[i] / units::MM) +
                " mm, limits " + numberText(travel[0] / units::MM) + " to " +
                numberText(travel[1] / units::MM) + " mm (machine)");
      }
      out += AXES[i] + fixedDecimals(*axis[i], options_.decimals) + " ";
    }
    return out;
  }

  std::string mCode(int code) {
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
        notUnderstood("M" + std::to_string(code) + " is not understood");
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

void MotionLimits::validate() const {
  for (std::size_t i = 0; i < 3; ++i) {
    if (!(travel[i][0] < travel[i][1])) {
      throw Error(std::string("travel_") + "xyz"[i] + ": [" + numberText(travel[i][0]) + ", " +
                  numberText(travel[i][1]) + "] m: expected the lower limit first");
    }
  }
  require("max_feed", max_feed, Range::positive(), "m/s");
  require("max_spindle_speed", max_spindle_speed, Range::positive(), "rad/s");
  checkBounds(*this);
}

NcCheck checkProgram(const std::string& program, const StartPosition& start, const MotionLimits& limits,
                     const DialectOptions& options) {
  NcCheck check;
  ProgramInterpreter interpreter(start, limits, options);
  std::istringstream lines(program);
  std::string line;
  for (int count = 1; std::getline(lines, line); ++count) {
    try {
      interpreter.block(line);
    } catch (const Refusal& refusal) {
      check.verdict = refusal.verdict;
      check.message = "line " + std::to_string(count) + ": " + refusal.message;
      check.end = start.machine;
      return check;
    }
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
  const long steps = std::lround(std::fmod(angle, units::TWO_PI) / units::TWO_PI * ORIENT_STEPS);
  return "#" + std::to_string(macro) + "=" +
         std::to_string((steps % ORIENT_STEPS + ORIENT_STEPS) % ORIENT_STEPS) + "\nM119\n";
}

std::string fixedDecimals(double value, int decimals) {
  const std::string text = formatted("%.*f", decimals, value);
  const bool minus_zero = text[0] == '-' && text.find_first_not_of("-0.") == std::string::npos;
  return minus_zero ? text.substr(1) : text;
}

}  // namespace smartmill::cnc
