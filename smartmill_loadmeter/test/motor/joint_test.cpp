#include "smartmill_loadmeter/motor/joint.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A feed drive: F = m (I - Ia), Cheng & Venuvinod eq. 3; m is negative when the weight aids the motion more
/// than friction opposes it.
struct FeedDrive {
  double newton_per_ampere = 0.0;      ///< [N/A] m, per range of the current
  double newton_per_ampere_std = 0.0;  ///< [N/A]
  double air_current = 0.0;            ///< [A] range in air, same direction of motion
  double current_std = 0.0;            ///< [A] of a mean current

  /// Cutting force that opposes the drive's motion [N].
  Estimate opposing(double current) const;
};

Estimate FeedDrive::opposing(double current) const {
  const double rise = current - air_current;
  return {newton_per_ampere * rise,
          std::hypot(newton_per_ampere_std * rise, newton_per_ampere * current_std)};
}

std::optional<Estimate> axisForce(const FeedDrive& drive, double current, double velocity, double smallest) {
  if (std::abs(velocity) < smallest) return std::nullopt;
  Estimate force = drive.opposing(current);
  if (velocity > 0.0) force.value = -force.value;
  return force;
}

/// Machine whose feed drives draw current for friction, weight and cutting force, without information at
/// rest.
struct Machine {
  std::mt19937 random;
  std::normal_distribution<double> normal;
  CuttingCoefficients truth;
  ToolGeometry tool{4, 0.016, units::radFromDeg(30.0), {}};
  std::array<FeedDrive, 3> drives{
      FeedDrive{215.9, 2.0, 1.1, 0.03}, FeedDrive{198.0, 2.0, 1.3, 0.03},
      FeedDrive{-198.45, 2.0, 1.3, 0.03}};  // Z: its weight aids the feed downwards
  std::array<double, 3> actual{};
  double torque_std = 0.01;

  explicit Machine(unsigned seed) : random(seed) {
    std::uniform_real_distribution<double> uniform;
    const double ktc = 400e6 + 1600e6 * uniform(random), kte = 10e3 + 25e3 * uniform(random);
    truth = {ktc, ktc * (0.2 + 0.3 * uniform(random)), ktc * (0.15 + 0.2 * uniform(random)),
             kte, kte * (0.8 + 0.5 * uniform(random)), kte * (0.2 + 0.5 * uniform(random))};
    for (std::size_t a = 0; a < 3; ++a) {
      actual[a] = drives[a].newton_per_ampere + drives[a].newton_per_ampere_std * normal(random);
    }
  }

  JointMeasurement cut(const Engagement& e, double heading, const std::array<double, 3>& velocity) {
    const CuttingForce f = MechanisticForce(tool, truth, e).mean();
    const double c = std::cos(heading), s = std::sin(heading);
    const std::array<double, 3> force{c * f.fx - s * f.fy, s * f.fx + c * f.fy, f.fz};
    JointMeasurement r;
    r.tool = tool;
    r.engagement = e;
    r.heading = heading;
    r.torque = Estimate{f.torque + torque_std * normal(random), torque_std};
    for (std::size_t a = 0; a < 3; ++a) {
      const double opposing = velocity[a] > 0.0 ? -force[a] : force[a];
      const double moving = std::abs(velocity[a]) > 0.0 ? drives[a].air_current + opposing / actual[a] : 0.0;
      r.axis_force[a] =
          axisForce(drives[a], moving + drives[a].current_std * normal(random), velocity[a], 1e-6);
    }
    return r;
  }
};

const double PI = units::PI;

TEST(Joint, torqueAndTheFeedAxisGiveTangentialAndRadialButNotAxial) {
  Machine m(1);
  std::vector<JointMeasurement> readings;
  for (const double feed : {4e-5, 7e-5, 1e-4, 1.3e-4}) {
    readings.push_back(m.cut({0.0, PI, 0.003, feed}, 0.0, {0.01, 0.0, 0.0}));
  }
  EXPECT_FALSE(readings[0].axis_force[1]);  // Y is at rest: passive
  EXPECT_FALSE(readings[0].axis_force[2]);
  const JointResult k = identifyJointly(readings);
  EXPECT_THAT(k.not_observable, ElementsAre("Kac", "Kae"));
  EXPECT_TRUE(std::isnan(k.value.kac) && std::isnan(k.std_dev.kae) && std::isnan(k.covariance[2]));
  EXPECT_NEAR(k.value.krc, m.truth.krc, 3.0 * k.std_dev.krc);
  EXPECT_NEAR(k.value.ktc, m.truth.ktc, 3.0 * k.std_dev.ktc);
}

TEST(Joint, torqueAloneGivesTangentialOnly) {
  Machine m(2);
  std::vector<JointMeasurement> readings;
  for (const double feed : {4e-5, 7e-5, 1e-4})
    readings.push_back(m.cut({0.0, PI, 0.003, feed}, 0.0, {0, 0, 0}));
  const JointResult k = identifyJointly(readings);
  EXPECT_THAT(k.not_observable, ElementsAre("Krc", "Kac", "Kre", "Kae"));
  EXPECT_NEAR(k.value.ktc, m.truth.ktc, 3.0 * k.std_dev.ktc);
}

TEST(Joint, rampsShowTheAxialCoefficientsToo) {
  Machine m(3);
  std::vector<JointMeasurement> readings;
  for (const double feed : {4e-5, 7e-5, 1e-4, 1.3e-4}) {
    readings.push_back(m.cut({0.0, PI, 0.003, feed}, 0.0, {0.01, 0.0, -0.0005}));
    readings.push_back(m.cut({0.0, PI, 0.003, feed}, 0.7, {0.007, 0.006, 0.0}));
  }
  const JointResult k = identifyJointly(readings);
  EXPECT_THAT(k.not_observable, IsEmpty());
  EXPECT_NEAR(k.value.kac, m.truth.kac, 3.0 * k.std_dev.kac);
  EXPECT_NEAR(k.value.kae, m.truth.kae, 3.0 * k.std_dev.kae);
}

// Turning: a taper moves both axes, so that torque, feed force and passive force determine all six.
TEST(Joint, taperTurningShowsAllCoefficients) {
  const CuttingCoefficients truth{1500e6, 700e6, 300e6, 40e3, 50e3, 20e3};
  const double c = std::cos(units::PI / 6.0), s = std::sin(units::PI / 6.0), depth = 1e-3, radius = 0.025;
  std::vector<JointMeasurement> cuts;
  for (const double feed : {0.1e-3, 0.2e-3, 0.3e-3}) {
    const double tangential = depth * (truth.ktc * feed + truth.kte),
                 normal = depth * (truth.krc * feed + truth.kre),
                 passive = depth * (truth.kac * feed + truth.kae);
    JointMeasurement cut;
    cut.tool.diameter = 2.0 * radius;
    cut.engagement.axial_depth = depth;
    cut.engagement.feed_per_tooth = feed;
    cut.heading = std::atan2(-c, -s);  // towards -Z and the axis
    cut.torque = Estimate{tangential * radius, 0.01};
    cut.axis_force[0] = Estimate{normal * s + passive * c, 1.0};
    cut.axis_force[2] = Estimate{normal * c - passive * s, 1.0};
    cuts.push_back(cut);
  }
  const JointResult found = identifyJointly(cuts);
  EXPECT_THAT(found.not_observable, IsEmpty());
  EXPECT_NEAR(found.value.ktc, truth.ktc, 1e-6 * truth.ktc);
  EXPECT_NEAR(found.value.krc, truth.krc, 1e-6 * truth.krc);
  EXPECT_NEAR(found.value.kac, truth.kac, 1e-6 * truth.kac);
  EXPECT_NEAR(found.value.kte, truth.kte, 1e-6 * truth.kte);
  EXPECT_NEAR(found.value.kre, truth.kre, 1e-6 * truth.kre);
  EXPECT_NEAR(found.value.kae, truth.kae, 1e-6 * truth.kae);
}

TEST(Joint, oneFeedIsNamedAsNotObservable) {
  Machine m(4);
  std::vector<JointMeasurement> readings;
  for (int i = 0; i < 5; ++i) readings.push_back(m.cut({0.0, PI, 0.003, 7e-5}, 0.0, {0.01, 0.0, 0.0}));
  EXPECT_THAT(errorOf([&] { identifyJointly(readings); }), HasSubstr("none of the six is observable"));
  JointMeasurement silent;
  silent.tool = m.tool;
  silent.engagement = {0.0, PI, 0.003, 7e-5};
  EXPECT_THAT(errorOf([&] { identifyJointly({silent}); }),
              HasSubstr("no measurement with a torque or a moving axis"));
}

TEST(Joint, medianErrorsOfManyMachinesAreWithinTenPercentAndCalibrated) {
  std::vector<double> krc, kac;
  Coverage radial, axial;
  const int runs = Coverage::RUNS;
  for (int run = 0; run < runs; ++run) {
    Machine m(static_cast<unsigned>(run) + 10);
    std::vector<JointMeasurement> readings;
    for (const double feed : {3e-5, 6e-5, 9e-5, 1.2e-4, 1.5e-4}) {
      readings.push_back(m.cut({0.0, PI, 0.003, feed}, 0.0, {0.01, 0.0, -0.0005}));
      readings.push_back(m.cut({0.0, PI / 2, 0.003, feed}, PI / 2, {0.0, 0.01, 0.0}));
    }
    const JointResult k = identifyJointly(readings);
    krc.push_back(std::abs(k.value.krc / m.truth.krc - 1.0));
    kac.push_back(std::abs(k.value.kac / m.truth.kac - 1.0));
    radial.add(k.value.krc - m.truth.krc, k.std_dev.krc);
    axial.add(k.value.kac - m.truth.kac, k.std_dev.kac);
  }
  std::sort(krc.begin(), krc.end());
  std::sort(kac.begin(), kac.end());
  EXPECT_LT(krc[runs / 2], 0.10);
  EXPECT_LT(kac[runs / 2], 0.10);
  EXPECT_TRUE(radial.isCalibrated());
  EXPECT_TRUE(axial.isCalibrated());
}

}  // namespace
}  // namespace smartmill::loadmeter
