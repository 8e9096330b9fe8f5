#include "smartmill_core/range.h"

#include <cmath>

#include "smartmill_core/formatted.h"

namespace smartmill {

std::string shortNumber(double value) {
  return formatted("%.10g", value);
}

bool Range::contains(double value) const {
  return std::isfinite(value) && (low_open ? value > low : value >= low) &&
         (high_open ? value < high : value <= high);
}

std::string Range::text() const {
  const bool has_low = std::isfinite(low), has_high = std::isfinite(high);
  if (has_low && has_high) {
    return shortNumber(low) + (low_open ? " < value " : " <= value ") + (high_open ? "< " : "<= ") +
           shortNumber(high);
  }
  if (has_low) return (low_open ? "> " : ">= ") + shortNumber(low);
  if (has_high) return (high_open ? "< " : "<= ") + shortNumber(high);
  return "finite";
}

std::string outOfRange(double value, const Range& range, const std::string& unit) {
  return shortNumber(value) + " is out of range (" + range.text() + (unit == "1" ? "" : " " + unit) + ")";
}

}  // namespace smartmill
