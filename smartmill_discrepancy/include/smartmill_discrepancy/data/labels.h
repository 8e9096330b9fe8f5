#pragma once

#include <string>
#include <vector>

#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// What of a campaign is not as it is labelled, one line each, e.g. "fx and fy look swapped in tests slot_1,
/// slot_2".
struct Labels {
  std::vector<std::string> wrong;  ///< channels swapped, channel in another unit, spindle at another speed
  /// A test that another's label fits. What acts in that test most looks alike: see doubtfulWith().
  std::vector<std::string> doubtful;
};

/// Compares with the nominal model; looks only for what would be far larger than any effect of the catalogue.
Labels checkLabels(const Dataset& data, int threads);

/// Labels::doubtful beside a model that has what was found: those that it does not clear are wrong.
std::vector<std::string> doubtfulWith(const MachineModel& model, const Dataset& data, int threads);

}  // namespace smartmill::discrepancy
