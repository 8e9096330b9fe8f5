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

/// Text of a program whose F words change; everything else stays byte for byte.
class FeedText {
 public:
  explicit FeedText(const std::string& text);

  /// Whether a line has an F word. @param line from 1
  bool hasFeed(int line) const;
  /// Replaces the number of the F word of a line, or adds the word behind the last word.
  /// @throws Error "line N: ..." on a comment within the F word
  void setFeed(int line, const std::string& number);
  /// @throws Error as setFeed
  std::string text() const;

 private:
  std::vector<std::string> lines_;  // with their ends
};

}  // namespace smartmill::program
