#pragma once

#include <optional>
#include <string>

#include "smartmill_sim/controller/nc_block.h"

namespace smartmill::sim {

[[noreturn]] void illegalAddress(const std::string& what);

/// Reads values from the significant characters of a block. The value of a single vacant variable is empty;
/// within an expression a vacant variable is 0.
class NcReader {
 public:
  NcReader(const std::string& text, const NcVariables& variables) : text_(text), variables_(variables) {}

  bool done() const { return position_ == text_.size(); }
  char peek() const { return done() ? '\0' : text_[position_]; }
  char next() { return done() ? '\0' : text_[position_++]; }
  /// Consumes a word at the present position. @return whether it was there
  bool accept(const std::string& word);
  /// The remaining text.
  std::string rest() const { return text_.substr(position_); }

  /// Value after an address: a number, #n or [expression], with a sign.
  std::optional<double> value(const std::string& address);
  /// An integer 0..99999999.
  std::optional<int> integer(const std::string& address);
  /// As integer(), but not vacant.
  int number(const std::string& address);
  /// Sum of products after "#n=".
  std::optional<double> expression();

 private:
  std::optional<double> product();
  std::optional<double> term();
  std::optional<double> variable();
  double bracket();
  double literal(const std::string& address);

  const std::string& text_;
  const NcVariables& variables_;
  std::size_t position_ = 0;
  int depth_ = 0;
};

}  // namespace smartmill::sim
