#pragma once

#include <limits>
#include <string>

namespace smartmill {

/// Allowed numbers of a key. Infinite bounds are open.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_open = false;   ///< low itself is not allowed
  bool high_open = false;  ///< high itself is not allowed

  bool contains(double value) const;
  std::string text() const;  ///< e.g. "> 0", "0 <= value < 80"; "finite" without bounds

  static Range positive() { return above(0.0); }
  static Range notNegative() { return atLeast(0.0); }
  static Range above(double low) { return {low, std::numeric_limits<double>::infinity(), true, false}; }
  static Range atLeast(double low) { return {low, std::numeric_limits<double>::infinity(), false, false}; }
  static Range closed(double low, double high) { return {low, high, false, false}; }  ///< both ends allowed
  static Range open(double low, double high) { return {low, high, true, true}; }      ///< neither
  static Range openLow(double low, double high) { return {low, high, true, false}; }
  static Range openHigh(double low, double high) { return {low, high, false, true}; }
};

/// A number for messages, at most ten digits.
std::string shortNumber(double value);

/// "0.7 is out of range (0 <= value < 0.5)", the text after the key in a message. @param unit "1": none
std::string outOfRange(double value, const Range& range, const std::string& unit = "1");

}  // namespace smartmill
