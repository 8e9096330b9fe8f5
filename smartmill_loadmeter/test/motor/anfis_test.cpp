// ANFIS as a method of the motor-current force (Cheng & Venuvinod, section 11).
#include "smartmill_loadmeter/motor/anfis.h"

#include <cmath>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/motor/motor_chain.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;

TEST(AnfisLearning, hybridRuleLearnsWhatALineCannot) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform;
  std::vector<std::vector<double>> inputs, unseen;
  std::vector<double> outputs, truth;
  const auto function = [](double a, double b) { return 10.0 * std::sin(2.5 * a) + 20.0 * b * b; };
  for (int i = 0; i < 400; ++i) {
    const double a = uniform(random), b = uniform(random);
    (i % 2 ? unseen : inputs).push_back({a, 500.0 * b});
    (i % 2 ? truth : outputs).push_back(function(a, b));
  }
  Anfis::Parameters once;
  once.epochs = 1;
  const Anfis first(inputs, outputs, once);
  const Anfis trained(inputs, outputs, Anfis::Parameters());
  EXPECT_LT(trained.trainingRms(), first.trainingRms());
  double squares = 0.0;
  for (std::size_t i = 0; i < unseen.size(); ++i) squares += std::pow(trained(unseen[i]) - truth[i], 2);
  EXPECT_LT(std::sqrt(squares / 200.0), 0.25);  // of a range of 30
  EXPECT_THAT(errorOf([&] { trained({1.0}); }), HasSubstr("expected 2 inputs"));
}

/// Drive of 200 N/A and spindle of 1.2 N m/A with field weakening above 1576 rpm.
struct Machine {
  explicit Machine(unsigned seed) : random(seed) {}

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  double torqueOf(double rise, double rpm) const { return 1.2 * rise * std::min(1.0, 1576.0 / rpm); }

  MotorCalibration calibrate(int cuts) {
    std::vector<StandardCut> standard;
    std::vector<MachineCurrents> currents;
    for (int i = 0; i < cuts; ++i) {
      const double rise = uniform(0.5, 3.0), spindle_rise = uniform(2.0, 12.0), rpm = uniform(1000.0, 3500.0);
      StandardCut cut;
      MachineCurrents current;
      cut.name = current.name = "cut" + std::to_string(i);
      cut.force[0] = 200.0 * rise + SCATTER * normal(random);
      cut.torque = torqueOf(spindle_rise, rpm) + TORQUE_SCATTER * normal(random);
      current.current[0] = 1.5 + rise, current.air[0] = 1.5;
      current.spindle_current = 4.0 + spindle_rise, current.spindle_air = 4.0;
      current.spindle_speed = units::radPerSecFromRpm(rpm);
      standard.push_back(cut), currents.push_back(current);
    }
    return calibrateMotors(standard, currents, units::radPerSecFromRpm(10000.0));
  }

  static MotorMeasurement measured(double rise, double spindle_rise, double rpm) {
    MotorMeasurement m;
    m.velocity = {-0.02, 0.0, 0.0};  // against the motion is positive
    m.range[0] = 1.5 + rise;
    m.spindle_range = 4.0 + spindle_rise;
    m.spindle_speed = units::radPerSecFromRpm(rpm);
    return m;
  }

  static constexpr double SCATTER = 15.0, TORQUE_SCATTER = 0.15;  // [N], [N m] of one cut
  std::mt19937 random;
  std::normal_distribution<double> normal;
};

MotorParameters parametersOf(const std::string& method) {
  MotorParameters p;
  p.method = method;
  return p;
}

TEST(AnfisMethod, deviationsAreCalibrated) {
  Coverage force, torque;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    Machine machine(static_cast<unsigned>(run + 1));
    const MotorCalibration calibration = machine.calibrate(60);
    const double rise = machine.uniform(0.95, 2.55), spindle_rise = machine.uniform(3.8, 10.2),
                 rpm = machine.uniform(1450.0, 3050.0);
    const MotorForce found =
        forceFromMotors(Machine::measured(rise, spindle_rise, rpm), {Machine::measured(0.0, 0.0, rpm)},
                        calibration, parametersOf("anfis"));
    ASSERT_TRUE(found.force[0] && found.torque) << found.text();
    // One new cut has the scatter of the cuts of the calibration.
    force.add(found.force[0]->value - (200.0 * rise + Machine::SCATTER * machine.normal(machine.random)),
              found.force[0]->std_dev);
    torque.add(found.torque->value - (machine.torqueOf(spindle_rise, rpm) +
                                      Machine::TORQUE_SCATTER * machine.normal(machine.random)),
               found.torque->std_dev);
  }
  EXPECT_TRUE(force.isCalibrated()) << force.rms();
  EXPECT_TRUE(torque.isCalibrated()) << torque.rms();
}

// A straight drive with noise of 2 N: both methods predict a cut left out about as well as the noise permits,
// sqrt(1 + 1/n) of it and more. A drive that saturates (F = 100 sin(r)): ANFIS is several times better.
TEST(MethodErrors, regressionAndAnfisAtCutsLeftOut) {
  std::mt19937_64 random(12);
  std::normal_distribution<double> noise(0.0, 2.0);
  CalibrationSamples straight, bent;
  for (int i = 0; i < 30; ++i) {
    const double rise = 0.05 + 0.05 * i;
    straight.add({rise}, 90.0 * rise + noise(random));
    bent.add({rise}, 100.0 * std::sin(rise) + noise(random));
  }
  const auto line = driveErrors(straight), curve = driveErrors(bent);
  ASSERT_TRUE(line && curve);
  EXPECT_EQ(line->cuts, 28u);  // the first and the last are outside the range of the others
  EXPECT_NEAR(line->regression, 2.0, 0.6);
  EXPECT_NEAR(line->anfis, 2.0, 0.8);
  EXPECT_LT(curve->anfis, 3.0);
  EXPECT_GT(curve->regression, 3.0 * curve->anfis);
  straight.inputs.resize(8);
  straight.outputs.resize(8);
  EXPECT_FALSE(driveErrors(straight));  // 7 others, ANFIS requires 8
}

TEST(AnfisMethod, nothingIsExtrapolated) {
  Machine machine(1);
  const MotorCalibration calibration = machine.calibrate(60);
  const auto found = [&](double rise, double spindle_rise, double rpm, const std::string& method) {
    return forceFromMotors(Machine::measured(rise, spindle_rise, rpm), {Machine::measured(0.0, 0.0, rpm)},
                           calibration, parametersOf(method));
  };
  const MotorForce large = found(5.0, 20.0, 2000.0, "anfis");
  EXPECT_FALSE(large.force[0] || large.torque);
  EXPECT_THAT(large.reason[0],
              HasSubstr("rise of the current [A] 5 outside the calibration of its ANFIS, 0."));
  EXPECT_THAT(large.reason[3], HasSubstr("rise of the current [A] 20 outside"));
  EXPECT_THAT(large.text(), HasSubstr("Fx not observable: rise of the current"));
  EXPECT_THAT(found(1.0, 5.0, 6000.0, "anfis").reason[3], HasSubstr("spindle speed [rpm] 6000 outside"));
  EXPECT_TRUE(found(5.0, 20.0, 2000.0, "regression").force[0]);
  // A line needs three cuts, the network more.
  const MotorCalibration few = machine.calibrate(7);
  const MotorForce refused = forceFromMotors(
      Machine::measured(1.0, 5.0, 2000.0), {Machine::measured(0.0, 0.0, 2000.0)}, few, parametersOf("anfis"));
  EXPECT_EQ(refused.reason[0], "ANFIS requires 8 cuts of the calibration, found 7");
  EXPECT_EQ(refused.reason[3], "ANFIS requires 24 cuts of the calibration, found 7");
}

TEST(AnfisMethod, aStoredCalibrationGivesTheSameForces) {
  const TemporaryFolder folder;
  Machine machine(2);
  const MotorCalibration calibration = machine.calibrate(40);
  writeMotorCalibration(calibration, folder.file("motors.yaml"));
  const MotorCalibration again = readMotorCalibration(folder.file("motors.yaml"));
  const auto by = [](const MotorCalibration& c) {
    return forceFromMotors(Machine::measured(1.5, 6.0, 2000.0), {Machine::measured(0.0, 0.0, 2000.0)}, c,
                           parametersOf("anfis"));
  };
  ASSERT_TRUE(by(again).force[0] && by(again).torque);
  EXPECT_EQ(by(again).force[0]->value, by(calibration).force[0]->value);
  EXPECT_EQ(by(again).force[0]->std_dev, by(calibration).force[0]->std_dev);
  EXPECT_EQ(by(again).torque->value, by(calibration).torque->value);
}

}  // namespace
}  // namespace smartmill::loadmeter
