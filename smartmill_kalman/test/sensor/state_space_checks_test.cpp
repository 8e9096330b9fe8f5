#include "smartmill_kalman/sensor/state_space_checks.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace smartmill::kalman {
namespace {

ModalModel one(double zeta) {
  ModalModel model;
  model.modes = {{1000.0, zeta, 1.0}};
  return model;
}

TEST(Balance, HankelValuesOfOneMode) {
  // w^2 / (s^2 + 2 zeta w s + w^2): Gramians by hand give
  // sigma^2 = (1 / 4 zeta) (1 / 4 zeta + zeta / 2 +- sqrt(1 + zeta^2) / 2), whatever w.
  for (const double zeta : {0.02, 0.1, 0.5}) {
    const Balanced balanced = balance(stateSpace(one(zeta)));
    const double middle = 0.25 / zeta + 0.5 * zeta, half = 0.5 * std::sqrt(1.0 + zeta * zeta);
    EXPECT_NEAR(balanced.hankel[0], std::sqrt(0.25 / zeta * (middle + half)), 1e-9 / zeta);
    EXPECT_NEAR(balanced.hankel[1], std::sqrt(0.25 / zeta * (middle - half)), 1e-9 / zeta);
    EXPECT_DOUBLE_EQ(balanced.bound, 0.0);
  }
}

TEST(Balance, KeepsTheResponseAndItsBound) {
  ModalModel model = ReferenceCase::exactSensor();
  model.modes.push_back({4700.0, 0.05, 2e-4});  // hardly there
  model.direct -= 2e-4;
  const StateSpace space = stateSpace(model);
  const Balanced all = balance(space), shorter = balanceTo(space, 1e-3);
  EXPECT_EQ(shorter.space.a.rows(), 6);
  EXPECT_GT(shorter.bound, 0.0);
  for (double f = 0.0; f < 8000.0; f += 37.0) {
    EXPECT_NEAR(std::abs(responseOf(all.space, f) - model.response(f)), 0.0, 1e-9) << f;
    EXPECT_LE(std::abs(responseOf(shorter.space, f) - model.response(f)), shorter.bound * (1.0 + 1e-6)) << f;
  }
  EXPECT_NEAR(std::abs(responseOf(companionForm(model), 1300.0) - model.response(1300.0)), 0.0, 1e-6);
  EXPECT_THROW(balance(space, 9), Error);
}

TEST(CheckStateSpace, TellsTheFormsApart) {
  // Burzoni 4.4: companion matrices of modes in rad/s are ill-conditioned; a transformation corrects this.
  const auto checks = checkSensor(ReferenceCase::exactSensor());
  ASSERT_EQ(checks.size(), 5u);
  // In seconds the companion's poles are lost in the rounding: it may even look unstable.
  for (std::size_t i = 1; i < checks.size(); ++i) {
    EXPECT_TRUE(checks[i].stable) << checks[i].form;
    EXPECT_GT(checks[i].margin, 0.0) << checks[i].form;
  }
  EXPECT_FALSE(checks[0].conditioned);  // 9110^2 14451^2 22619^2 rad^6/s^6 = 9e24 next to 1
  // Companion: the observability matrix is the unit matrix; a mode is two rotating states.
  EXPECT_NEAR(checks[0].observability_condition, 1.0, 1e-9);
  EXPECT_LT(checks[1].condition, 10.0);
  EXPECT_LT(checks[3].condition, 10.0);
  EXPECT_LT(checks[2].observability_condition, 1e-6 * checks[1].observability_condition);
  EXPECT_TRUE(checks[2].observable);
  EXPECT_TRUE(checks[3].observable);
  EXPECT_EQ(checks[4].states, 7);
  EXPECT_EQ(checks[4].rank, 7);  // eq. 4-41: 2 k + 1
}

TEST(CheckStateSpace, SeesAnUnobservableAndAnUnstableMode) {
  StateSpace space = stateSpace(ReferenceCase::exactSensor());
  // Two modes of one frequency and damping are not distinguishable by one output.
  ModalModel twice = one(0.03);
  twice.modes.push_back(twice.modes[0]);
  const auto time = 1.0 / (units::TWO_PI * 1000.0);
  EXPECT_FALSE(checkStateSpace(stateSpace(twice), "twice", time).observable);
  EXPECT_LT(checkStateSpace(stateSpace(twice), "twice", time).margin, 1e-9);
  space.a *= -1.0;
  EXPECT_FALSE(checkStateSpace(space, "backwards").stable);
  EXPECT_THROW(balance(space), Error);
}

}  // namespace
}  // namespace smartmill::kalman
