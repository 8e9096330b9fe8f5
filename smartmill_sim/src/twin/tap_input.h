#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_core/campaign/record.h"

namespace smartmill::sim {

/// Force of a tap: zero outside the contact (Dunwoody section 4.3.1), where the record contains only noise,
/// which would excite the sensor's modes. A record with further hits is left unchanged.
std::vector<double> contactForce(const std::vector<double>& hammer);

/// Target of a tap: the tool tip, the sensor or (if a record contains both responses) both. A channel
/// responds if its peak after the hit exceeds its noise.
struct TapTarget {
  bool tip, sensor;
};
TapTarget targetOf(const Record& record, std::size_t axis);

}  // namespace smartmill::sim
