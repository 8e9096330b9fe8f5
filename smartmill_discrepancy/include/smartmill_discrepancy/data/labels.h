#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// Wrong labels of a campaign, one line each, e.g. "fx and fy look swapped in tests slot_1, slot_2".
struct Labels {
  std::vector<std::string> wrong;  ///< swapped channels, wrong unit, wrong spindle speed
  /// Tests that another test's label fits better. A missing effect that acts in one test looks the same: see
  /// doubtfulLabels().
  std::vector<std::string> doubtful;
};

/// Compares with the nominal model; detects only errors far larger than any effect of the catalogue.
Labels checkLabels(const Dataset& data, int threads);

/// Labels::doubtful with a model that includes the effects found: labels that stay doubtful are wrong.
std::vector<std::string> doubtfulLabels(const MachineModel& model, const Dataset& data, int threads);

}  // namespace smartmill::discrepancy
