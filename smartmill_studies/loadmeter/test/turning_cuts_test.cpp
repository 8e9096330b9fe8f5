#include "loadmeter/turning_cuts.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

MachineModel lathe() {
  return readMachineModel("../../launch/models/lathe.yaml");
}

/// Cuts of another day: other noise, feeds, depths and a speed between those of the standard cuts.
std::vector<LatheCut> otherCuts(const MotorCalibration& calibration, const std::string& method) {
  sim::TurningTraits passes = standardPasses();
  passes.passes.angle = {0.0, 0.0, units::radFromDeg(30.0), units::radFromDeg(40.0), 0.5 * units::PI};
  passes.passes.feed = {1.3e-4, 1.9e-4, 1.6e-4, 1.7e-4, 1.5e-4};
  passes.passes.depth = {0.8e-3, 0.6e-3, 0.8e-3, 0.7e-3, 0.6e-3};
  return runLathe(latheTraits(65.0, 7), passes, lathe(), latheParameters(method), calibration);
}

void expectWithin(const char* what, const std::string& cut, const std::optional<Estimate>& e, double truth) {
  ASSERT_TRUE(e) << cut << ": " << what;
  std::printf("%s: %s %.2f +- %.2f, true %.2f\n", cut.c_str(), what, e->value, e->std_dev, truth);
  EXPECT_GT(e->std_dev, 0.0);
  EXPECT_NEAR(e->value, truth, 3.0 * e->std_dev) << cut << ": " << what;
}

// Cheng & Venuvinod, sections 9 to 11, from the tables of `calibrate` to the force of other cuts: a passive
// force has no current, and every estimate agrees with the truth within three of the standard deviations that
// it states.
TEST(TurningCuts, currentsOfTheLatheBecomeForces) {
  std::vector<LatheCut> standard;
  for (const double speed : {45.0, 57.5, 75.0}) {
    const auto some =
        runLathe(latheTraits(speed, 1), standardPasses(), lathe(), latheParameters(), std::nullopt);
    standard.insert(standard.end(), some.begin(), some.end());
  }
  ASSERT_EQ(standard.size(), 36u);
  const TemporaryFolder folder;
  writeTables(standard, folder.file("cuts.csv"), folder.file("currents.csv"));
  const MotorCalibration calibration = calibrateMotors(
      readStandardCuts(folder.file("cuts.csv")), readMachineCurrents(folder.file("currents.csv")), 165.0);
  ASSERT_TRUE(calibration.drive[0] && calibration.drive[2] && calibration.spindle);
  EXPECT_FALSE(calibration.drive[1]);  // never moves
  // Table 1: the weight of the X slide aids the infeed, which reverses the sign.
  for (const auto& [axis, truth] : {std::pair{0, -198.45}, std::pair{2, 215.9}}) {
    const Estimate& m = calibration.drive[static_cast<std::size_t>(axis)]->newton_per_ampere;
    std::printf("drive %d: %.2f +- %.2f N/A, true %.2f\n", axis, m.value, m.std_dev, truth);
    EXPECT_NEAR(m.value, truth,
                3.0 * m.std_dev + 0.01 * std::abs(truth));  // warm-up changes it by less than 1 %
  }
  for (const char* method : {"regression", "anfis"}) {
    SCOPED_TRACE(method);
    for (const LatheCut& cut : otherCuts(calibration, method)) {
      ASSERT_TRUE(cut.motors && cut.estimate) << cut.name;
      const std::string name = std::string(method) + " " + cut.name;
      EXPECT_EQ(cut.motors->reason[1], "the axis is at rest");
      for (const std::size_t axis : {0u, 2u}) {
        if (std::abs(cut.cut.velocity[axis]) > 1e-4) {
          expectWithin(axis == 0 ? "Fx by its motor" : "Fz by its motor", name, cut.motors->force[axis],
                       cut.force[axis]);
        } else {
          EXPECT_FALSE(cut.motors->force[axis]) << name;
          EXPECT_EQ(cut.motors->reason[axis], "the axis is at rest");
        }
        expectWithin(axis == 0 ? "Fx" : "Fz", name, cut.estimate->mean[axis], cut.force[axis]);
      }
      expectWithin("torque by the spindle motor", name, cut.motors->torque, cut.torque);
      expectWithin("Fy", name, cut.estimate->mean[1], cut.force[1]);
      EXPECT_TRUE(std::isnan(cut.estimate->rms[0].value)) << "no mechanics of the variation";
    }
  }
}

}  // namespace
}  // namespace smartmill::loadmeter
