#pragma once

#include <cstddef>
#include <vector>

namespace smartmill {

/// A channel of a hit minus its baseline.
struct HitChannel {
  std::vector<double> values;
  double noise = 0.0, largest = 0.0;
};

/// @param before samples before the hit
HitChannel hitChannel(const std::vector<double>& values, std::size_t before);

/// First sample after the contact.
std::size_t contactEnd(const HitChannel& force);

}  // namespace smartmill
