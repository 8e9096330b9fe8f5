#pragma once

#include <functional>
#include <optional>
#include <string_view>

namespace smartmill::nc {

/// Properties of a control's dialect, on which the reader depends.
struct Dialect {
  std::string_view addresses;    ///< letters that begin a word
  std::string_view blanks;       ///< characters that are ignored
  bool strict_comments = false;  ///< '(' within a comment and ')' outside of one are errors
  /// A value may be #n or an expression in brackets with + - * / SIN COS SQRT (degrees), and an assignment
  /// may have a sequence number.
  bool expressions = false;
  /// With expressions: the functions of Fanuc's macro B (TAN ASIN ACOS ATAN ABS ROUND FIX FUP EXP LN), MOD
  /// AND OR XOR, and comparisons in brackets (EQ NE GT GE LT LE), whose value is 1 or 0.
  bool macros = false;
};

/// Value of a variable #n; nullopt: vacant. May throw.
using Variables = std::function<std::optional<double>(int)>;

constexpr int LARGEST_INTEGER = 99999999;  ///< of eight digits, as programs and sequence numbers of a 30i

}  // namespace smartmill::nc
