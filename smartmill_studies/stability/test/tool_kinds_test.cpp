#include "stability/tool_kinds.h"

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

ToolKindOptions options() {
  ToolKindOptions o;
  o.speed_low = units::radPerSecFromRpm(5000.0);
  o.speed_high = units::radPerSecFromRpm(12000.0);
  o.max_depth = 30e-3;
  o.entry_deg = 45.0;
  o.exit_deg = 135.0;
  o.seed = 11;
  o.points = 2;
  return o;
}

// The study counts 60 cuts of each kind. The chip is thick at both ends of the arc: where it ends at zero,
// the step of the entry leads out of the cut, and the twin chatters a few percent below the limit (bistable).
TEST(ToolKinds, limitsAgreeWithTheTwin) {
  const MachineModel model = readMachineModel(std::string(MODEL_FOLDER) + "/tools.yaml");
  for (const ToolKind& kind : toolKinds(*model.tool)) {
    if (kind.name != "bull nose" && kind.name != "face mill" && kind.name != "variable helix") continue;
    for (const CutAtLimit& cut : cutsAtLimit(model, kind, options()))
      EXPECT_TRUE(cut.right(0.03)) << kind.name << " " << units::rpmFromRadPerSec(cut.speed) << " rpm, "
                                   << cut.depth << " of " << cut.limit << " m";
  }
}

TEST(ToolKinds, refusesWhatCannotBe) {
  MachineModel model = readMachineModel(std::string(MODEL_FOLDER) + "/tools.yaml");
  ToolKindOptions none = options();
  none.points = 0;
  EXPECT_THROW(cutsAtLimit(model, toolKinds(*model.tool).front(), none), Error);
  model.tool->teeth = 2;
  EXPECT_THROW(toolKinds(*model.tool), Error);
}

}  // namespace
}  // namespace smartmill::stability
