#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "smartmill_core/nc/cursor.h"
#include "smartmill_core/nc/dialect.h"

namespace smartmill::nc {

/// Reads values at a cursor. A number has a sign, digits and at most one point, no exponent. The value of a
/// single vacant variable is vacant; within an expression a vacant variable is 0. Functions throw
/// SyntaxError.
class ValueReader {
 public:
  /// The cursor must outlive the reader.
  ValueReader(Cursor& cursor, const Dialect& dialect, Variables variables);

  /// Value of a word: a number or, with expressions, #n or [expression] with a sign.
  /// @param address for messages. @param column of the word
  std::optional<double> wordValue(const std::string& address, std::size_t column);
  /// Right side of an assignment: a number or, with expressions, a sum of products.
  std::optional<double> assignedValue(const std::string& address, std::size_t column);
  [[noreturn]] void refuse() const;

 private:
  std::optional<double> sum();
  std::optional<double> product();
  std::optional<double> term();
  std::optional<double> variable();
  double bracket();
  std::optional<double> function();
  double arcTangent();
  bool compare(std::optional<double> left);
  double number(const std::string& address, std::size_t column);

  Cursor& cursor_;
  bool expressions_, macros_;
  Variables variables_;
  int depth_ = 0;  // of brackets
};

}  // namespace smartmill::nc
