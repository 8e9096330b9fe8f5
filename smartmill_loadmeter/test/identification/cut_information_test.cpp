#include "smartmill_loadmeter/identification/cut_information.h"

#include <Eigen/Dense>

#include <array>
#include <cmath>
#include <functional>
#include <iostream>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

constexpr double GAIN = 3.88e-4, VOLT = 2e-4, NEWTON = 0.5;
const ToolGeometry TOOL{4, 0.01905, units::radFromDeg(30.0), {}};

Spindle spindle() {
  Spindle s;
  s.load_meter_gain = GAIN;
  return s;
}

CuttingCondition air(double speed) {
  CuttingCondition test;
  test.kind = CuttingCondition::Kind::air;
  test.tool = TOOL;
  test.spindle_speed = speed;
  return test;
}

CuttingCondition cut(double entry_deg, double exit_deg, double depth, double feed, double speed = 418.9) {
  CuttingCondition test = air(speed);
  test.kind = CuttingCondition::Kind::cut;
  test.engagement = {units::radFromDeg(entry_deg), units::radFromDeg(exit_deg), depth, feed};
  return test;
}

// Unknowns in N/mm2, N/mm, N m and N m s: Ktc, Kte, Krc, Kre, Coulomb and viscous friction.
using Unknowns = std::array<double, 6>;
const Unknowns UNIT{units::N_PER_MM2, units::N_PER_MM, units::N_PER_MM2, units::N_PER_MM, 1.0, 1e-3};

// Mean voltage, Fx and Fy of a test, by integration of the forces over a revolution.
Eigen::Vector3d measured(const CuttingCondition& test, const Unknowns& at) {
  constexpr int STEPS = 14400;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  if (test.kind == CuttingCondition::Kind::cut) {
    const CuttingCoefficients k{at[0] * UNIT[0], at[2] * UNIT[2], 0.0, at[1] * UNIT[1], at[3] * UNIT[3], 0.0};
    const MechanisticForce force(test.tool, k, test.engagement);
    for (int i = 0; i < STEPS; ++i) {
      const CuttingForce now = force.at(units::TWO_PI * (i + 0.5) / STEPS);
      mean += Eigen::Vector3d{now.torque, now.fx, now.fy} / STEPS;
    }
  }
  mean[0] += at[4] * UNIT[4] + at[5] * UNIT[5] * test.spindle_speed;
  mean[0] *= GAIN * test.spindle_speed;
  return mean;
}

// Covariance of weighted least squares with numerical derivatives of the load model.
Eigen::MatrixXd byDifferences(const std::vector<CuttingCondition>& tests, bool forces) {
  const Unknowns about{800.0, 20.0, 250.0, 15.0, 0.1, 0.4};
  const Eigen::Index n = 6;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  for (const CuttingCondition& test : tests) {
    Eigen::MatrixXd slopes(3, n);
    for (std::size_t i = 0; i < about.size(); ++i) {
      Unknowns above = about, below = about;
      above[i] *= 1.01, below[i] *= 0.99;
      slopes.col(static_cast<Eigen::Index>(i)) =
          (measured(test, above) - measured(test, below)) / (0.02 * about[i]);
    }
    slopes.row(0) /= VOLT;
    slopes.bottomRows(2) /= NEWTON;
    const bool with_forces = forces && test.kind == CuttingCondition::Kind::cut;
    information += slopes.topRows(with_forces ? 3 : 1).transpose() * slopes.topRows(with_forces ? 3 : 1);
  }
  if (forces) return information.inverse();
  const std::vector<Eigen::Index> torque{0, 1, 4, 5};
  return Eigen::MatrixXd(information(torque, torque)).inverse();
}

std::vector<CuttingCondition> mixedTests() {
  return {air(314.0),
          air(942.0),
          cut(0.0, 180.0, 1e-3, 5e-5),
          cut(0.0, 90.0, 2e-3, 1e-4),
          cut(90.0, 180.0, 1.5e-3, 2e-4),
          cut(0.0, 60.0, 3e-3, 1.5e-4, 628.3),
          cut(135.0, 180.0, 2e-3, 1e-4),
          cut(50.0, 110.0, 1e-3, 2e-4)};
}

CutInformation informationOf(const std::vector<CuttingCondition>& tests, bool forces) {
  CutInformation information;
  for (const CuttingCondition& test : tests) {
    information.addTest(test, spindle(), VOLT);
    if (forces && test.kind == CuttingCondition::Kind::cut) information.addForces(test, NEWTON);
  }
  return information;
}

// The integral over 14400 angles has a relative error below 1e-3 at the steps of entry and exit.
constexpr double INTEGRAL = 2e-3;

TEST(CutInformation, isThatOfTheNumericalDerivativesForAnyImmersion) {
  const PlaneCovariance expected = informationOf(mixedTests(), false).covariance();
  const Eigen::MatrixXd numerical = byDifferences(mixedTests(), false);
  for (std::size_t i = 0; i < 2; ++i) {
    for (std::size_t j = 0; j < 2; ++j) {
      const double value = numerical(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
      EXPECT_NEAR(expected.at(i, j) / (UNIT[i] * UNIT[j]) / value, 1.0, INTEGRAL) << i << j;
    }
  }
  EXPECT_TRUE(std::isinf(expected.stdOf(PLANE_KRC)) && std::isinf(expected.stdOf(PLANE_KRE)))
      << "the torque does not depend on radial forces";
}

TEST(CutInformation, ofAForceSensorIncludesTheRadialCoefficients) {
  const PlaneCovariance expected = informationOf(mixedTests(), true).covariance();
  const Eigen::MatrixXd numerical = byDifferences(mixedTests(), true);
  for (std::size_t i = 0; i < PLANE_COEFFICIENTS; ++i) {
    for (std::size_t j = 0; j < PLANE_COEFFICIENTS; ++j) {
      const auto at = [&](std::size_t a, std::size_t b) {
        return numerical(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
      };
      EXPECT_NEAR(expected.at(i, j) / (UNIT[i] * UNIT[j]) / std::sqrt(at(i, i) * at(j, j)),
                  at(i, j) / std::sqrt(at(i, i) * at(j, j)), INTEGRAL)
          << i << j;
    }
  }
}

// Mean Fx of a slot: -N a (f Krc / 4 + Kre / pi).
TEST(CutInformation, slotsDetermineTheRadialCoefficientsByTheForceAlongTheFeed) {
  const double depth = 1e-3, low = 5e-5, high = 2e-4;
  CutInformation information;
  information.addForces(cut(0.0, 180.0, depth, low), NEWTON);
  information.addForces(cut(0.0, 180.0, depth, high), NEWTON);
  const PlaneCovariance c = information.covariance();
  const double of_krc = NEWTON * std::sqrt(2.0) * 4.0 / (TOOL.teeth * depth * (high - low));
  EXPECT_NEAR(c.stdOf(PLANE_KRC), of_krc, 1e-6 * of_krc);
  const double of_kre = NEWTON * units::PI * std::hypot(low, high) / (TOOL.teeth * depth * (high - low));
  EXPECT_NEAR(c.stdOf(PLANE_KRE), of_kre, 1e-6 * of_kre);
  EXPECT_NEAR(c.stdOf(PLANE_KTC), of_krc, 1e-6 * of_krc) << "Fy = N a (f Ktc / 4 + Kte / pi)";
}

// Torque N a R / (2 pi) (f (cos entry - cos exit) Ktc + (exit - entry) Kte): half immersion of twice the
// depth has the torque of a slot, up or down; of the same depth half of it, a quarter of the information.
TEST(CutInformation, ofHalfImmersionIsThatOfASlotOfHalfTheDepth) {
  const auto covarianceOf = [](double entry, double exit, double depth) {
    CutInformation information;
    for (const double feed : {5e-5, 2e-4})
      information.addAboveAir(cut(entry, exit, depth, feed), spindle(), VOLT);
    return information.covariance().torque();
  };
  const TorqueCovariance slot = covarianceOf(0.0, 180.0, 1e-3);
  for (const auto& [entry, exit] : {std::pair{0.0, 90.0}, std::pair{90.0, 180.0}}) {
    const TorqueCovariance same = covarianceOf(entry, exit, 1e-3), twice = covarianceOf(entry, exit, 2e-3);
    EXPECT_NEAR(same.tc / slot.tc, 4.0, 1e-6);
    EXPECT_NEAR(same.te / slot.te, 4.0, 1e-6);
    EXPECT_NEAR(twice.tc / slot.tc, 1.0, 1e-6);
    EXPECT_NEAR(twice.tc_te / slot.tc_te, 1.0, 1e-6);
  }
  // A smaller immersion has relatively more edge force: Kte becomes more certain per torque than by a slot.
  const auto ratio = [](double exit) {
    const auto map = meanForceMatrix(TOOL, {0.0, units::radFromDeg(exit), 1e-3, 1e-4});
    return map[3][3] / map[3][0];
  };
  EXPECT_GT(ratio(30.0), 2.0 * ratio(180.0));
}

TEST(CutInformation, entropyIsHalfTheLogarithmOfTheDeterminant) {
  CutInformation before;
  EXPECT_TRUE(std::isinf(before.entropy()));
  before.addKnowledge({1e16, 0.0, 1e8});
  EXPECT_NEAR(before.entropy(), std::log(0.1 * 10.0), 1e-12) << "0.1 GPa and 10 N/mm";
  CutInformation after = before;
  after.addKnowledge({1e16, 0.0, 1e8});
  EXPECT_NEAR(before.entropy() - after.entropy(), std::log(2.0), 1e-12) << "both variances are halved";
}

}  // namespace
// Through an inner corner at half immersion the immersion grows from 90 to 180 degrees and returns. The depth
// is limited by the largest immersion, the information by all: at the same depth, feeds and time a slot, read
// in the same parts, leaves smaller standard deviations of both coefficients.
TEST(CutInformation, ACornerIsLessInformativeThanASlotOfItsDepth) {
  constexpr int PARTS = 20;
  const auto covarianceOf = [](bool corner, bool up) {
    CutInformation information;
    for (const double speed : {314.0, 628.0, 942.0}) information.addTest(air(speed), spindle(), VOLT);
    for (const double feed : {5e-5, 1e-4, 2e-4}) {
      for (int k = 0; k < PARTS; ++k) {
        const double immersion = corner ? 180.0 - 90.0 * std::abs((2.0 * k + 1.0) / PARTS - 1.0) : 180.0;
        const CuttingCondition part =
            up ? cut(0.0, immersion, 1e-3, feed) : cut(180.0 - immersion, 180.0, 1e-3, feed);
        information.addTest(part, spindle(), VOLT * std::sqrt(PARTS));
      }
    }
    return information.covariance();
  };
  for (const bool up : {true, false}) {
    const PlaneCovariance slot = covarianceOf(false, up), corner = covarianceOf(true, up);
    EXPECT_LT(slot.stdOf(PLANE_KTC), corner.stdOf(PLANE_KTC)) << up;
    EXPECT_LT(slot.stdOf(PLANE_KTE), corner.stdOf(PLANE_KTE)) << up;
    std::cout << "corner over slot: Ktc " << corner.stdOf(PLANE_KTC) / slot.stdOf(PLANE_KTC) << ", Kte "
              << corner.stdOf(PLANE_KTE) / slot.stdOf(PLANE_KTE) << "\n";
  }
}

}  // namespace smartmill::loadmeter
