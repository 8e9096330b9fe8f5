#pragma once

#include <string>
#include <vector>

#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// How large something shows in one test.
struct Shown {
  const TestData* test = nullptr;
  double amplitude = 0.0, std_dev = 1.0;
};

/// Conditions of the tests that the size goes with, the strongest first: cutting (cuts show it, the rest do
/// not), speed, chip_load, depth, immersion, time. Nothing where the sizes differ by no more than chance.
std::vector<std::string> dependence(const std::vector<Shown>& shown);

}  // namespace smartmill::discrepancy
