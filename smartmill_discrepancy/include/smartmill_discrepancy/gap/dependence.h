#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// Amplitude of a component in one test.
struct TestAmplitude {
  const TestData* test = nullptr;
  double amplitude = 0.0, std_dev = 1.0;
};

/// Conditions that the amplitude depends on, the strongest first: cutting (present in cuts only), speed,
/// chip_load, depth, immersion, time. Empty if the amplitudes agree within their uncertainty.
std::vector<std::string> dependentConditions(const std::vector<TestAmplitude>& amplitudes);

}  // namespace smartmill::discrepancy
