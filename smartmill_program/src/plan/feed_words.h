#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace smartmill::program {

/// The lines of a text with their ends.
std::vector<std::string> linesOf(const std::string& text);

/// A number of an F word that is at most `value` by less than 0.1 %: four significant digits, without
/// exponent; "0" below 1e-8.
std::string feedNumberUpTo(double value);
/// The value of an F word as a number of at most twelve digits.
std::string feedNumberOf(double value);

/// Text of a program whose F and S words change; everything else stays byte for byte.
class ProgramWords {
 public:
  explicit ProgramWords(const std::string& text);

  /// Whether a line has a word. @param line from 1 @param letter F or S
  bool has(int line, char letter) const;
  /// Replaces the number of the word of a line, or adds the word behind the last word.
  /// @throws Error "line N: ..." on a comment within the word
  void set(int line, char letter, const std::string& number);
  std::string text() const;

 private:
  std::vector<std::string> lines_;  // with their ends
};

}  // namespace smartmill::program
