#include "smartmill_core/require.h"

#include <cmath>
#include <string>

#include "smartmill_core/error.h"

namespace smartmill {

void require(const char* key, double value, const Range& range, const char* unit) {
  if (!range.contains(value)) throw Error(std::string(key) + ": " + outOfRange(value, range, unit));
}

void require(bool good, const char* key, double value, const char* expected) {
  if (!good || !std::isfinite(value))
    throw Error(std::string(key) + ": " + shortNumber(value) + ", expected " + expected);
}

}  // namespace smartmill
