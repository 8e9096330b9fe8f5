#include "stability/twin_agreement.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_stability/solvers/model_system.h"

namespace smartmill::stability {
namespace {

AgreementOptions options() {
  AgreementOptions o;
  o.speed_low = units::radPerSecFromRpm(6000.0);
  o.speed_high = units::radPerSecFromRpm(20000.0);
  o.max_depth = 10e-3;
  o.points = 12;
  return o;
}

// The simulator of smartmill_sim is independent of smartmill_stability, so that its records validate the
// solver. rosrun smartmill_studies stability_twin_agreement runs 400 points.
TEST(TwinAgreement, twelveCutsOfTheSimulator) {
  MachineModel model = readMachineModel(MODEL_FILE);
  model.tool->helix = units::radFromDeg(30.0);
  const auto points = agreementWithTwin(model, systemOf(model, 90.0, 180.0), options());
  ASSERT_EQ(points.size(), 12u);
  int agree = 0, chatter = 0;
  for (const AgreementPoint& p : points) {
    agree += p.agrees();
    chatter += p.chatters();
  }
  EXPECT_EQ(agree, 12);
  EXPECT_GT(chatter, 2);
  EXPECT_LT(chatter, 10);
}

// 5 % immersion, 20,000 rpm: flip at 3.250386 mm in the tables, where zero-order theory gives 6.850 mm.
TEST(TwinAgreement, theSimulatorFindsTheFlipThatZeroOrderMisses) {
  const MachineModel model = readMachineModel(MODEL_FILE);
  std::vector<TwinCut> cuts(2);
  for (TwinCut& cut : cuts) {
    cut.speed = units::radPerSecFromRpm(20000.0);
    cut.engagement = Engagement{units::PI - std::acos(0.9), units::PI, 3.18e-3, 0.1e-3};
    cut.samples = 720;  // the arc is 26 deg long
    cut.revolutions = 400;
  }
  cuts[1].engagement.axial_depth = 3.32e-3;
  runTwinCuts({model}, cuts, {{"tool_x", "tool_y"}}, [](std::size_t i, const Record& record) {
    EXPECT_EQ(repeatsNoMore(record, 720, 360, 0.1e-3), i == 1);
    // With two teeth the flip repeats every revolution.
    EXPECT_FALSE(repeatsNoMore(record, 720, 720, 0.1e-3)) << i;
  });
}

TEST(TwinAgreement, refusesWhatCannotBe) {
  EXPECT_THROW(runTwinCuts(std::vector<MachineModel>(2), std::vector<TwinCut>(3), {}, {}), Error);
  AgreementOptions o = options();
  o.points = 0;
  EXPECT_THROW(o.validate(), Error);
  o = options();
  o.speed_high = o.speed_low;
  EXPECT_THROW(o.validate(), Error);
}

Record vibration(double growth, double subharmonic) {
  constexpr int SAMPLES = 60, TURNS = 200;
  Record record;
  std::vector<double> u;
  for (int i = 0; i < SAMPLES * TURNS; ++i) {
    const double t = static_cast<double>(i) / SAMPLES;
    u.push_back(1e-4 * std::cos(units::TWO_PI * 4.0 * t) +
                subharmonic * std::exp(growth * t) * std::cos(units::TWO_PI * 3.3 * t));
    record.time.push_back(t);
  }
  record.add("tool_x") = u;
  record.add("tool_y").assign(u.size(), 0.0);
  return record;
}

TEST(RepeatsNoMore, onlyWhatStaysOrGrows) {
  EXPECT_FALSE(repeatsNoMore(vibration(0.0, 0.0), 60, 60, 1e-4));
  EXPECT_FALSE(repeatsNoMore(vibration(-0.05, 1e-4), 60, 60, 1e-4));
  EXPECT_TRUE(repeatsNoMore(vibration(0.0, 1e-4), 60, 60, 1e-4));
  EXPECT_TRUE(repeatsNoMore(vibration(0.02, 1e-6), 60, 60, 1e-4));
}

}  // namespace
}  // namespace smartmill::stability
