#pragma once

#include "smartmill_core/range.h"

namespace smartmill {

/// @throws Error "KEY: VALUE is out of range (RANGE)" for a value outside the range or not finite. @param
/// unit of value and range for the message; "1": none
void require(const char* key, double value, const Range& range, const char* unit = "1");

/// For conditions that are not a range. @throws Error "KEY: VALUE, expected EXPECTED" unless good and the
/// value is finite.
void require(bool good, const char* key, double value, const char* expected);

}  // namespace smartmill
