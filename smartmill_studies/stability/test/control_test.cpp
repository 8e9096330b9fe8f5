#include "stability/control_study.h"

#include <gtest/gtest.h>

#include "smartmill_stability/solvers/model_system.h"

namespace smartmill::stability {
namespace {

// Machines 2 % off in frequency: the override ends the chatter in the time domain, and the recommended next
// cut is stable.
TEST(ChatterControl, endsChatterInTheTwin) {
  MachineModel model = readMachineModel(MODEL_FOLDER "/stiff.yaml");
  model.uncertainty.frequency = 2.0;
  model.uncertainty.damping = model.uncertainty.stiffness = model.uncertainty.cutting = 5.0;
  ControlOptions options;
  options.speed_low = units::radPerSecFromRpm(6000.0);
  options.speed_high = units::radPerSecFromRpm(12000.0);
  options.max_depth = 20e-3;
  options.cuts = 4;
  options.seed = 1;
  options.control.adaptive = true;
  const auto cuts = controlStudy(model, systemOf(model, 90.0, 180.0), options);
  int ended = 0;
  for (const ControlCut& cut : cuts) {
    ASSERT_EQ(cut.moves, 1) << cut.reason;
    ended += cut.end();
    if (cut.end()) {
      EXPECT_LT(cut.ended - cut.requested, 150.0);
      EXPECT_GT(cut.removal, cut.careful);
    } else {
      EXPECT_TRUE(cut.next_stable) << cut.reason;
    }
  }
  EXPECT_GE(ended, 1);
}

}  // namespace
}  // namespace smartmill::stability
