#include "stability/twin_agreement.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_stability/chart/process_damping.h"
#include "smartmill_stability/solvers/model_system.h"

namespace smartmill::stability {
namespace {

constexpr double LOW_RPM = 900.0;

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

// Process damping of 60 N/mm: the limit is 2.75 times that without at 900 rpm and 1.05 times at 15,000 rpm.
// The simulator computes the force of each tooth's flank in time; its limit lies within 3 % of the solver's.
TEST(TwinAgreement, processDampingAtLowAndHighSpeed) {
  MachineModel model = readMachineModel(MODEL_FILE);
  const double bare = makeSolver(Method::collocation, systemOf(model, 90.0, 180.0))
                          ->limit(units::radPerSecFromRpm(LOW_RPM), 10e-3)
                          .depth;
  ProcessDampingEstimate given;
  given.coefficient = 60e3;
  model = withProcessDamping(model, given);
  const RegenerativeSystem system = systemOf(model, 90.0, 180.0);
  const auto solver = makeSolver(Method::collocation, system);
  for (const double rpm : {LOW_RPM, 15000.0}) {
    const double speed = units::radPerSecFromRpm(rpm), limit = solver->limit(speed, 10e-3).depth;
    if (rpm == LOW_RPM) {
      EXPECT_GT(limit, 2.7 * bare);
    }
    // 40 samples of the vibration of 922 Hz; as long in time at both speeds.
    const int samples = wholeTeeth(std::max(360, static_cast<int>(40.0 * 60.0 * 922.0 / rpm)), system.teeth);
    std::vector<TwinCut> cuts;
    for (const double share : {0.97, 1.03})
      cuts.push_back({speed,
                      {system.entry, system.exit, share * limit, 0.1e-3},
                      samples,
                      std::max(100, static_cast<int>(rpm / 60.0 * 2.0)),
                      0});
    runTwinCuts({model}, cuts, {{"tool_x", "tool_y"}}, [&](std::size_t i, const Record& record) {
      EXPECT_EQ(repeatsNoMore(record, samples, samples / system.teeth, 0.1e-3), i == 1) << rpm;
    });
  }
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
