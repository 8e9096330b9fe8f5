#include "smartmill_sim/controller/nc_block.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>

namespace smartmill::sim {
namespace {

// Numbers of program alarms, as a 30i has them.
constexpr int PS_TOO_MANY_DIGITS = 3;
constexpr int PS_ILLEGAL_ADDRESS = 9;
constexpr int PS_IMPROPER_G = 10;
constexpr int PS_MACRO_FORMAT = 114;

constexpr std::size_t MAX_DIGITS = 12;

[[noreturn]] void illegal(const std::string& what) {
  throw NcAlarm(PS_ILLEGAL_ADDRESS, ALARM_PS, "IMPROPER NC ADDRESS " + what);
}

/// Only what the control looks at: no blanks, no comments, upper case.
std::string significant(const std::string& line) {
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
  if (comment) {
    illegal("(");
  }
  return text;
}

class BlockReader {
 public:
  explicit BlockReader(const std::string& text) : text_(text) {}

  bool done() const { return at_ == text_.size(); }
  char next() { return done() ? '\0' : text_[at_++]; }

  /// Sign, digits, at most one point; no exponent.
  double number(const std::string& address) {
    const std::size_t start = at_;
    at_ = std::min(text_.size(), at_ + (at_ < text_.size() && (text_[at_] == '-' || text_[at_] == '+')));
    std::size_t digits = 0, points = 0;
    for (; at_ < text_.size(); ++at_) {
      if (std::isdigit(static_cast<unsigned char>(text_[at_]))) {
        ++digits;
      } else if (text_[at_] == '.') {
        ++points;
      } else {
        break;
      }
    }
    if (digits == 0 || points > 1) {
      illegal(address + text_.substr(start, at_ - start));
    }
    if (digits > MAX_DIGITS) {
      throw NcAlarm(PS_TOO_MANY_DIGITS, ALARM_PS, "TOO MANY DIGITS " + address);
    }
    return std::strtod(text_.substr(start, at_ - start).c_str(), nullptr);
  }

  int whole(const std::string& address) {
    const double value = number(address);
    if (value < 0.0 || value > 99999999.0 || value != std::floor(value)) {
      illegal(address);
    }
    return static_cast<int>(value);
  }

 private:
  const std::string& text_;
  std::size_t at_ = 0;
};

void once(bool already, char address) {
  if (already) {
    illegal(std::string("TWICE ") + address);
  }
}

void gCode(int code, NcBlock& block, bool& dwell) {
  switch (code) {
    case 0:
    case 1:
      once(block.motion.has_value() || dwell, 'G');
      block.motion = code;
      return;
    case 4:
      once(block.motion.has_value() || dwell, 'G');
      dwell = true;
      return;
    case 90:
    case 91:
      once(block.relative.has_value(), 'G');
      block.relative = code == 91;
      return;
    default:
      throw NcAlarm(PS_IMPROPER_G, ALARM_PS, "IMPROPER G-CODE G" + std::to_string(code));
  }
}

void mCode(int code, NcBlock& block) {
  once(block.m_code.has_value(), 'M');
  if (code != 2 && code != 3 && code != 5 && code != 30 && code != 119) {
    illegal("M" + std::to_string(code));
  }
  block.m_code = code;
}

void setOnce(std::optional<double>& value, BlockReader& reader, char address) {
  once(value.has_value(), address);
  value = reader.number(std::string(1, address));
}

/// In G4 the words X (s) and P (ms) are times.
void takeDwell(NcBlock& block, const std::optional<double>& milliseconds) {
  if (block.axis[1] || block.axis[2] || block.axis[0].has_value() == milliseconds.has_value()) {
    illegal("IN G4");
  }
  block.dwell = milliseconds ? *milliseconds * 1e-3 : *block.axis[0];
  block.axis[0].reset();
  if (*block.dwell < 0.0) {
    illegal("IN G4");
  }
}

NcBlock parseAssignment(BlockReader& reader) {
  NcBlock block;
  reader.next();
  block.macro = reader.whole("#");
  if (reader.next() != '=') {
    throw NcAlarm(PS_MACRO_FORMAT, ALARM_PS, "ILLEGAL EXPRESSION FORMAT");
  }
  block.macro_value = reader.number("#=");
  if (!reader.done()) {
    throw NcAlarm(PS_MACRO_FORMAT, ALARM_PS, "ILLEGAL EXPRESSION FORMAT");
  }
  return block;
}

NcBlock parseWords(BlockReader& reader) {
  NcBlock block;
  bool dwell = false;
  std::optional<double> milliseconds;
  while (!reader.done()) {
    const char address = reader.next();
    const std::string name(1, address);
    switch (address) {
      case 'N':
        once(block.sequence.has_value(), address);
        block.sequence = reader.whole(name);
        break;
      case 'G':
        gCode(reader.whole(name), block, dwell);
        break;
      case 'X':
      case 'Y':
      case 'Z':
        setOnce(block.axis[static_cast<std::size_t>(address - 'X')], reader, address);
        break;
      case 'P':
        setOnce(milliseconds, reader, address);
        break;
      case 'F':
        setOnce(block.feed, reader, address);
        break;
      case 'S':
        setOnce(block.speed, reader, address);
        break;
      case 'M':
        mCode(reader.whole(name), block);
        break;
      default:
        illegal(name);
    }
  }
  if (dwell) {
    takeDwell(block, milliseconds);
  } else if (milliseconds) {
    illegal("P");
  }
  if ((block.feed && *block.feed < 0.0) || (block.speed && *block.speed < 0.0)) {
    illegal(block.feed && *block.feed < 0.0 ? "F" : "S");
  }
  return block;
}

}  // namespace

NcAlarm::NcAlarm(int number, int type, const std::string& text, int axis)
    : Error(text), number_(number), type_(type), axis_(axis) {
}

NcBlock parseBlock(const std::string& line) {
  const std::string text = significant(line);
  if (text.empty() || text[0] == '%') {
    return {};
  }
  BlockReader reader(text);
  return text[0] == '#' ? parseAssignment(reader) : parseWords(reader);
}

}  // namespace smartmill::sim
