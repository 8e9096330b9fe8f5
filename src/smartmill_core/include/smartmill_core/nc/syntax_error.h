#pragma once

#include <cstddef>
#include <string>

#include "smartmill_core/error.h"

namespace smartmill::nc {

/// A block that the reader refuses. what() is "column 4: X1..2, expected a number"; the reader of the lines
/// puts "line 12, " in front.
class SyntaxError : public Error {
 public:
  enum class Kind {
    comment,       ///< '(' and ')' do not match
    address,       ///< not an address of the dialect
    control_flow,  ///< a word of macro programs: IF, GOTO ...
    number,        ///< not a number
    digits,        ///< too many digits
    integer,       ///< not an integer within its limits
    expression,    ///< malformed
    division,      ///< by zero
    argument       ///< of a function, or a result that is not finite
  };
  /// @param column in the line, from 1. @param address of the word, or the word of a control flow
  /// @param written what follows the address. @param fault what is wrong and what was expected
  SyntaxError(Kind kind, std::size_t column, const std::string& address, const std::string& written,
              const std::string& fault)
      : Error("column " + std::to_string(column) + ": " + fault),
        kind_(kind),
        address_(address),
        written_(written) {}

  Kind kind() const { return kind_; }
  const std::string& address() const { return address_; }
  const std::string& written() const { return written_; }

 private:
  Kind kind_;
  std::string address_, written_;
};

}  // namespace smartmill::nc
