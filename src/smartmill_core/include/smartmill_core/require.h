#pragma once

#include "smartmill_core/range.h"

namespace smartmill {

/// @throws Error "KEY: VALUE is out of range (RANGE)" for a value outside the range or that is no finite
/// number. @param unit of value and range for the message; "1": none
void require(const char* key, double value, const Range& range, const char* unit = "1");

/// Where a range does not say it. @throws Error "KEY: VALUE, DUE is due" unless good and the value a finite
/// number.
void require(bool good, const char* key, double value, const char* due);

}  // namespace smartmill
