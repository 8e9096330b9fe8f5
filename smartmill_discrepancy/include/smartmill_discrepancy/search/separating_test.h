#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/results/test_outcome.h"

namespace smartmill::discrepancy {

/// [1] of the noise by which the predictions of a test separate two models.
constexpr double MIN_SEPARATION = 0.3;

/// A test that distinguishes two models.
struct SeparatingTest {
  std::string text;         ///< description
  CampaignTest test;        ///< as a new test of the campaign
  double difference = 0.0;  ///< [1] RMS difference of the predictions over the noise
  TestOutcome outcome;      ///< without the names of the models
};

/// The cut or air cut with the largest difference of two models among variations of the campaign's tests.
std::optional<SeparatingTest> separatingTest(const Dataset& data, const MachineModel& a,
                                             const MachineModel& b);

}  // namespace smartmill::discrepancy
