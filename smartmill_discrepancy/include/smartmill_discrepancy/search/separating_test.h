#pragma once

#include <optional>
#include <string>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// A test that would tell two models apart.
struct SeparatingTest {
  std::string text;         ///< for people
  CampaignTest test;        ///< as one of the campaign, begun anew
  double difference = 0.0;  ///< [1] RMS of what the predictions differ by, over the noise
};

/// The cut or air cut, among variations of the campaign's tests, in which two models differ most.
std::optional<SeparatingTest> separatingTest(const Dataset& data, const MachineModel& a,
                                             const MachineModel& b);

}  // namespace smartmill::discrepancy
