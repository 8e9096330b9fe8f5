#include "loadmeter/turning_scene.h"

#include <cmath>
#include <fstream>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/motor/motor_calibration.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;

TEST(FeedDrive, weightAndFrictionOfTheSlideAreThoseOfThePaper) {
  Line x;
  x.slope = {-198.45, 2.0};
  // Air currents 1.3 A inward and 1.9 A outward (258 N / 198.45 N/A; the paper prints 13 and 19).
  const SlideLoad load = slideLoad(x, 1.3, 1.9, 0.01);
  // W + R = m Ia = -258 N: the weight aids; outward |m| 1.9 = 377 N.
  EXPECT_NEAR(load.weight.value + load.friction.value, -258.0, 0.1);
  EXPECT_NEAR(-load.weight.value + load.friction.value, 377.0, 0.1);
  EXPECT_NEAR(load.weight.value, -317.5, 0.1);
  EXPECT_NEAR(load.friction.value, 59.5, 0.1);  // positive: always opposes
}

TEST(Variances, splitAndFTestAreThoseOfTheFormulas) {
  const VarianceSplit s = splitVariance({10, 12, 14}, {11, 15, 19});
  EXPECT_DOUBLE_EQ(s.process_variance, 4.0);
  EXPECT_DOUBLE_EQ(s.current_variance, 16.0);
  EXPECT_DOUBLE_EQ(s.sensor_variance, 12.0);
  EXPECT_NEAR(s.f_means, 9.0 / (10.0 * 2.0 / 3.0), 1e-12);
  // Two-sided t = 1.1619 with 4 degrees of freedom: 1 - sin(u) (1 + cos(u)^2 / 2), tan(u) = t / 2.
  EXPECT_NEAR(s.p_means, 0.30988, 2e-5);
  EXPECT_NEAR(s.p_variances, 0.2, 1e-9);  // F(2, 2): 1 / (1 + F)
}

TEST(TurningScene, errorsAndVariancesAreThoseThatWerePutIn) {
  const TurningVariances v;
  const TurningResult r = studyTurning(3, v, 200);
  EXPECT_NEAR(r.z.slope.value, 215.9, 0.03 * 215.9);
  EXPECT_NEAR(r.x.slope.value, -198.45,
              0.25 * 198.45);  // 15 cuts; noise of the current reduces the slope
  EXPECT_GT(r.fit_y, 0.98);
  // The error of the prediction is between the noise of the sensor and the errors of the paper.
  EXPECT_GT(r.regression.rmse[1], 0.9 * std::sqrt(v.sensor[1]));
  EXPECT_LT(r.regression.rmse[0], 29.0);
  EXPECT_LT(r.regression.rmse[1], 36.0);
  EXPECT_LT(r.regression.rmse[2], 27.0);
  EXPECT_LT(r.anfis.rmse[1], 34.0);
  EXPECT_LT(r.anfis.rmse[2], 21.0);
  // 200 replications give a variance to 10 %, and the difference of two to about 20 %.
  EXPECT_NEAR(r.fy.process_variance, v.process[1], 0.3 * v.process[1]);
  EXPECT_NEAR(r.fz.process_variance, v.process[2], 0.3 * v.process[2]);
  EXPECT_NEAR(r.fy.sensor_variance, v.sensor[1], 0.6 * v.sensor[1]);
  EXPECT_NEAR(r.fz.sensor_variance, v.sensor[2], 0.6 * v.sensor[2]);
  EXPECT_LT(r.fy.p_variances, 1e-6);
}

// The 120 cuts of the turning centre as two tables: forces of the remote dynamometer and currents of this
// machine.
struct Tables {
  TurningCentre centre{3, {}};
  std::string standard, currents;

  explicit Tables(const TemporaryFolder& folder) {
    standard = folder.file("standard.csv");
    currents = folder.file("currents.csv");
    std::ofstream forces(standard), machine(currents);
    forces << "cut,force_x[N],force_z[N],torque[N m]\n";
    machine << "cut,spindle_speed[rpm],current_x[A],air_x[A],current_z[A],air_z[A],current_spindle[A],"
               "air_spindle[A]\n";
    int number = 0;
    for (const TurningCut& c : centre.calibrationTests(120)) {
      const std::string name = "c" + std::to_string(number++);
      // The dynamometer measures also the passive force; the axis at rest has no current.
      forces << name << "," << c.force[0] << "," << c.force[2] << ","
             << c.force[1] * (c.radius + 0.5 * c.depth) << "\n";
      machine << name << "," << c.speed_rpm << ",";
      if (c.moves_x) machine << c.current[0] << "," << 258.0 / 198.45;
      machine << (c.moves_x ? "," : ",,");
      if (c.moves_z) machine << c.current[2] << ",0.0";
      machine << (c.moves_z ? "," : ",,") << c.current[1] << "," << c.spindle_air << "\n";
    }
  }
};

TEST(StandardCuts, giveTheLawsOfTheTurningCentre) {
  const TemporaryFolder folder;
  Tables tables(folder);
  const MotorCalibration made =
      calibrateMotors(readStandardCuts(tables.standard), readMachineCurrents(tables.currents),
                      units::radPerSecFromRpm(1570.0));
  writeMotorCalibration(made, folder.file("motors.yaml"));
  const MotorCalibration c = readMotorCalibration(folder.file("motors.yaml"));
  ASSERT_TRUE(c.drive[0] && c.drive[2] && c.spindle);
  EXPECT_FALSE(c.drive[1]);
  // Table 1: weight pulls the X slide, its slope is negative. Noise of the current reduces slopes slightly.
  EXPECT_NEAR(c.drive[0]->newton_per_ampere.value, -198.45,
              4.0 * c.drive[0]->newton_per_ampere.std_dev + 6.0);
  EXPECT_NEAR(c.drive[2]->newton_per_ampere.value, 215.9, 4.0 * c.drive[2]->newton_per_ampere.std_dev);
  EXPECT_EQ(c.drive[2]->newton_per_ampere.value, made.drive[2]->newton_per_ampere.value);  // 17 digits
  // 300 cuts outside the calibration: the stated scatter agrees with the observed one. Table 2: sensor 260 N2
  // for Fz.
  double squares = 0.0, n = 0.0, torque2 = 0.0, all = 0.0;
  for (const TurningCut& cut : tables.centre.predictionTests(300)) {
    if (cut.moves_z) {
      const Estimate e = c.drive[2]->opposing(cut.current[2], 0.0);
      squares += std::pow((e.value - cut.force[2]) / e.std_dev, 2);
      n += 1.0;
    }
    const double torque = c.spindle->torque(cut.speed_rpm, cut.current[1] - cut.spindle_air);
    torque2 += std::pow(torque / (cut.radius + 0.5 * cut.depth) - cut.force[1], 2);
    all += 1.0;
  }
  EXPECT_NEAR(squares / n, 1.0, 0.3);
  EXPECT_LT(std::sqrt(torque2 / all), 36.0);  // the paper's RMSE of Fy
}

}  // namespace
}  // namespace smartmill::loadmeter
