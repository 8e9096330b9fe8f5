#include "smartmill_sim/controller/nc_block.h"

#include "smartmill_core/nc/block_reader.h"

namespace smartmill::sim {
namespace {

using nc::SyntaxError;

constexpr nc::Dialect DIALECT{"O:NGXYZIJRPFSMTH", std::string_view(" \t\n\v\f\r\0", 7), false, true};

[[noreturn]] void illegalAddress(const std::string& what) {
  throw NcAlarm(PS_ILLEGAL_ADDRESS, "IMPROPER NC ADDRESS " + what);
}

/// Number and text of the alarm with which a 30i refuses a block.
[[noreturn]] void throwAlarm(const SyntaxError& error) {
  switch (error.kind()) {
    case SyntaxError::Kind::comment:
    case SyntaxError::Kind::address:
    case SyntaxError::Kind::integer:
      illegalAddress(error.address());
    case SyntaxError::Kind::number:
      illegalAddress(error.address() + error.written());
    case SyntaxError::Kind::digits:
      throw NcAlarm(PS_TOO_MANY_DIGITS, "TOO MANY DIGITS " + error.address());
    case SyntaxError::Kind::control_flow:
      throw NcAlarm(PS_MACRO_FORMAT, error.address() + " IS NOT KNOWN");
    case SyntaxError::Kind::division:
      throw NcAlarm(PS_DIVIDED_BY_ZERO, "DIVIDED BY ZERO");
    case SyntaxError::Kind::argument:
      throw NcAlarm(PS_ILLEGAL_ARGUMENT, "ILLEGAL ARGUMENT");
    case SyntaxError::Kind::expression:
      break;
  }
  throw NcAlarm(PS_MACRO_FORMAT, "ILLEGAL EXPRESSION FORMAT");
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
    case 40:
    case 49:
    case 80:
      return;  // off: as at the start
    case 43:
      block.length_offset = true;
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
  for (const int known : {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 19, 30, 119}) {
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

NcBlock blockOf(const nc::Assignment& assignment) {
  NcBlock block;
  block.sequence = assignment.sequence;
  block.macro = assignment.variable;
  block.macro_value = assignment.value;
  return block;
}

/// Program and sequence numbers; one with a vacant variable is ignored.
std::optional<int> optionalInteger(const nc::Word& word) {
  return word.value ? std::optional<int>(nc::integer(word)) : std::nullopt;
}

/// Words whose place is not in the block.
struct OtherWords {
  bool dwell = false;
  std::optional<double> milliseconds;
  std::optional<int> length_offset;
};

void readWord(const nc::Word& word, NcBlock& block, OtherWords& other) {
  switch (word.address) {
    case 'O':
    case ':':
      setWord(block.program, optionalInteger(word), word.address);
      break;
    case 'N':
      setWord(block.sequence, optionalInteger(word), word.address);
      break;
    case 'G':
      readGCode(nc::integer(word), block, other.dwell);
      break;
    case 'X':
    case 'Y':
    case 'Z':
      setWord(block.axis[static_cast<std::size_t>(word.address - 'X')], word.value, word.address);
      break;
    case 'I':
    case 'J':
      setWord(block.centre[static_cast<std::size_t>(word.address - 'I')], word.value, word.address);
      break;
    case 'R':
      setWord(block.radius, word.value, word.address);
      break;
    case 'P':
      setWord(other.milliseconds, word.value, word.address);
      break;
    case 'F':
      setWord(block.feed, word.value, word.address);
      break;
    case 'S':
      setWord(block.speed, word.value, word.address);
      break;
    case 'M':
      readMCode(nc::integer(word), block);
      break;
    case 'T':
      setWord(block.tool, optionalInteger(word), word.address);
      break;
    case 'H':
      setWord(other.length_offset, optionalInteger(word), word.address);
      break;
    default:
      break;  // not in DIALECT
  }
}

NcBlock readWords(nc::BlockReader& reader) {
  NcBlock block;
  OtherWords other;
  while (const std::optional<nc::Word> word = reader.next()) readWord(*word, block, other);
  if (other.dwell) {
    readDwell(block, other.milliseconds);
  } else if (other.milliseconds) {
    illegalAddress("P");
  }
  if (block.length_offset != other.length_offset.has_value())
    illegalAddress(block.length_offset ? "G43" : "H");
  if ((block.feed && *block.feed < 0.0) || (block.speed && *block.speed < 0.0))
    illegalAddress(block.feed && *block.feed < 0.0 ? "F" : "S");
  return block;
}

}  // namespace

NcBlock parseBlock(const std::string& line, const NcVariables& variables) {
  try {
    nc::BlockReader reader(line, DIALECT, variables);
    if (reader.text().empty() || reader.text()[0] == '%') return {};
    return reader.assigns() ? blockOf(reader.assignment()) : readWords(reader);
  } catch (const SyntaxError& error) {
    throwAlarm(error);
  }
}

}  // namespace smartmill::sim
