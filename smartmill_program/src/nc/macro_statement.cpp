#include "macro_statement.h"

#include <array>
#include <cmath>
#include <string_view>

#include "block.h"
#include "smartmill_core/error.h"

namespace smartmill::program {
namespace {

using nc::Cursor;
using nc::ValueReader;
using Kind = MacroStatement::Kind;

constexpr int MAX_LOOP = 3;
constexpr int MAX_REPEATS = 9999;

/// Local variable of an argument of G65 (argument specification I); 0: not an argument.
int localOf(char address) {
  constexpr std::string_view ADDRESSES = "ABCDEFHIJKMQRSTUVWXYZ";
  constexpr std::array<int, ADDRESSES.size()> NUMBERS{1,  2,  3,  7,  8,  9,  11, 4,  5,  6, 13,
                                                      17, 18, 19, 20, 21, 22, 23, 24, 25, 26};
  const std::size_t at = ADDRESSES.find(address);
  return at == std::string_view::npos ? 0 : NUMBERS[at];
}

[[noreturn]] void refuse(std::size_t column, const std::string& message) {
  throw Error("column " + std::to_string(column) + ": " + message);
}

/// Skips N and its number.
std::optional<int> takeSequence(Cursor& cursor) {
  if (cursor.peek() != 'N' || !nc::isDigit(cursor.peek(1))) return std::nullopt;
  cursor.take();
  long number = 0;
  while (nc::isDigit(cursor.peek())) number = std::min(number * 10 + (cursor.take() - '0'), 1000000000L);
  return static_cast<int>(number);
}

/// Reads the statements of one line.
class Reader {
 public:
  Reader(const std::string& line, const MacroVariables& variables)
      : cursor_(line, MACRO_DIALECT),
        values_(cursor_, MACRO_DIALECT, [&variables](int number) { return variables.value(number); }) {}

  MacroStatement read() {
    takeSequence(cursor_);
    statement_.column = cursor_.column();
    if (cursor_.accept("IF")) {
      condition();
    } else if (cursor_.accept("GOTO")) {
      jump();
    } else if (cursor_.accept("WHILE")) {
      statement_.enters = truth("WHILE");
      if (!cursor_.accept("DO")) refuse(cursor_.column(), "WHILE without DO, expected DO1 to DO3");
      loop(Kind::loop_begin, "DO");
    } else if (cursor_.accept("DO")) {
      loop(Kind::loop_begin, "DO");
    } else if (cursor_.accept("END")) {
      loop(Kind::loop_end, "END");
    } else if (cursor_.peek() == '#') {
      assignment();
    } else if (cursor_.startsWith("G65") && !nc::isDigit(cursor_.peek(3)) && cursor_.peek(3) != '.') {
      call();
    } else {
      return statement_;
    }
    if (!cursor_.done()) refuse(cursor_.column(), "expected the end of the block");
    return statement_;
  }

 private:
  int integer(const std::string& name, int most) {
    const std::size_t column = cursor_.column();
    const std::optional<double> value = values_.wordValue(name, column);
    if (!value || !(*value >= 0.0 && *value <= most) || *value != std::floor(*value))
      refuse(column, name + " without an integer from 0 to " + std::to_string(most));
    return static_cast<int>(*value);
  }

  bool truth(const std::string& name) {
    if (cursor_.peek() != '[') refuse(cursor_.column(), name + " without a condition, expected [");
    return values_.wordValue(name, cursor_.column()).value_or(0.0) != 0.0;
  }

  void condition() {
    if (!truth("IF")) {
      // What follows is not evaluated.
      statement_.kind = Kind::nothing;
      while (!cursor_.done()) cursor_.take();
    } else if (cursor_.accept("THEN")) {
      assignment();
    } else {
      if (!cursor_.accept("GOTO")) refuse(cursor_.column(), "IF without GOTO or THEN");
      jump();
    }
  }

  void jump() {
    statement_.kind = Kind::jump;
    statement_.number = integer("GOTO", nc::LARGEST_INTEGER);
  }

  void loop(Kind kind, const char* name) {
    statement_.kind = kind;
    const std::size_t column = cursor_.column();
    statement_.number = integer(name, MAX_LOOP);
    if (statement_.number == 0) refuse(column, std::string(name) + "0, expected 1 to 3");
  }

  void assignment() {
    statement_.kind = Kind::assignment;
    if (cursor_.take() != '#') values_.refuse();
    statement_.number = integer("#", nc::LARGEST_INTEGER);
    if (cursor_.take() != '=') values_.refuse();
    statement_.value = values_.assignedValue("#=", cursor_.column());
  }

  void call() {
    statement_.kind = Kind::call;
    cursor_.accept("G65");
    bool has_program = false;
    while (!cursor_.done()) {
      const std::size_t column = cursor_.column();
      const char address = cursor_.take();
      if (address == 'P') {
        statement_.number = integer("P", nc::LARGEST_INTEGER);
        has_program = true;
        continue;
      }
      if (address == 'L') {
        statement_.repeats = integer("L", MAX_REPEATS);
        continue;
      }
      const int local = localOf(address);
      if (local == 0) refuse(column, std::string("G65 with ") + address + ", expected P, L or an argument");
      std::optional<double>& place = statement_.locals[static_cast<std::size_t>(local)];
      if (place) refuse(column, std::string("two words ") + address + " in one block");
      place = values_.wordValue(std::string(1, address), column);
    }
    if (!has_program) refuse(statement_.column, "G65 without P, expected the number of a subprogram");
  }

  Cursor cursor_;
  ValueReader values_;
  MacroStatement statement_;
};

/// Number of a loop behind a word at the end of a line, in any case: "DO" of WHILE [...] DO 1.
int loopNumber(const std::string& line, std::string_view word) {
  const Cursor cursor(line, MACRO_DIALECT);
  const std::string& text = cursor.text();
  if (text.size() <= word.size() || text.compare(text.size() - 1 - word.size(), word.size(), word) != 0)
    return 0;
  const char last = text.back();
  return last >= '1' && last <= '0' + MAX_LOOP ? last - '0' : 0;
}

}  // namespace

MacroStatement readMacroStatement(const std::string& line, const MacroVariables& variables) {
  return Reader(withoutSemicolon(line), variables).read();
}

std::optional<int> sequenceOf(const std::string& line) {
  Cursor cursor(withoutSemicolon(line), MACRO_DIALECT);
  return takeSequence(cursor);
}

int loopBeginOf(const std::string& line) {
  return loopNumber(withoutSemicolon(line), "DO");
}

int loopEndOf(const std::string& line) {
  return loopNumber(withoutSemicolon(line), "END");
}

}  // namespace smartmill::program
