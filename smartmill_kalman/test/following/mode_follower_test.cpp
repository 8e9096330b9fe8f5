#include "smartmill_kalman/following/mode_follower.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace smartmill::kalman {
namespace {

const ToolGeometry TOOL{4, 16e-3, units::radFromDeg(30.0), {}};
const Engagement SLOT{0.0, units::PI, 2e-3, 6e-5};

// Harmonics in closed form: the force of a tool with runout times the sensor's response.
ModeFollower::Harmonics harmonics(const ModalModel& sensor, double speed, int count) {
  CuttingLaw law;
  law.coefficients = {800e6, 250e6, 0.0, 20e3, 20e3, 0.0};
  RigidCut cut(TOOL, law, SLOT, runoutRadii(TOOL, 8e-6, 0.5));
  std::array<std::vector<double>, 2> force;
  for (int i = 0; i < 8192; ++i) {
    const CuttingForce f = cut.at(units::TWO_PI * i / 8192.0);
    force[0].push_back(f.fx);
    force[1].push_back(f.fy);
  }
  ModeFollower::Harmonics result;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto line = fourier(force[axis]);
    for (int n = 0; n <= count; ++n) {
      result[axis].push_back(line[static_cast<std::size_t>(n)] * ((n > 0 ? 2.0 : 1.0) / 8192.0) *
                             sensor.response(n * speed / units::TWO_PI));
    }
  }
  return result;
}

TEST(ModeFollower, FindsModesThatHaveMoved) {
  const double speed = units::radPerSecFromRpm(9000.0);
  const ModalModel model_sensor = ReferenceCase::exactSensor();
  ModalModel is = model_sensor;
  is.modes[0].frequency *= 1.02;
  is.modes[1].frequency *= 0.99;
  is.modes[2].damping_ratio *= 1.2;
  ModeFollower follower(TOOL, SLOT, 33, {});
  const auto update = follower.update(harmonics(is, speed, 33), 0.05, {model_sensor, model_sensor}, speed);
  ASSERT_TRUE(update.has_value());
  EXPECT_LT(update->after, 0.01 * update->before);
  for (const ModalModel& axis : update->sensor) {
    for (std::size_t k = 0; k < 3; ++k) {
      // Priors of 2 % and 10 % bias the result where the harmonics contain little information.
      EXPECT_NEAR(axis.modes[k].frequency, is.modes[k].frequency, 0.002 * is.modes[k].frequency) << k;
      EXPECT_NEAR(axis.modes[k].damping_ratio, is.modes[k].damping_ratio, 0.15 * is.modes[k].damping_ratio)
          << k;
    }
  }
}

ModalModel withOneMore() {
  ModalModel sensor = ReferenceCase::exactSensor();
  sensor.modes.push_back({3000.0, 0.03, 0.03});
  sensor.modes[0].gain -= 0.03;
  return sensor;
}

// A mode that is missing in the taps: the force through the identified sensor is the applied one.
TEST(ModeFollower, FindsAModeThatNoTapHasShown) {
  const ModalModel model_sensor = ReferenceCase::exactSensor(), is = withOneMore();
  for (const double rpm : {15000.0, 21750.0}) {
    const double speed = units::radPerSecFromRpm(rpm);
    const int count = static_cast<int>(5000.0 * units::TWO_PI / speed);
    ModeFollower follower(TOOL, SLOT, count, {});
    const auto measured_harmonics = harmonics(is, speed, count);
    const auto update = follower.update(measured_harmonics, 0.03, {model_sensor, model_sensor}, speed);
    ASSERT_TRUE(update.has_value()) << rpm;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      ASSERT_EQ(update->sensor[axis].modes.size(), 4u) << rpm;
      EXPECT_NEAR(update->sensor[axis].modes[3].frequency, 3000.0, 60.0) << rpm;
      EXPECT_NEAR(update->sensor[axis].staticGain(), 1.0, 1e-12);
      double error = 0.0, norm = 0.0;
      for (int n = 1; n <= count; ++n) {
        const auto y = measured_harmonics[axis][static_cast<std::size_t>(n)];
        const double f = n * speed / units::TWO_PI;
        error += std::norm(y / update->sensor[axis].response(f) - y / is.response(f));
        norm += std::norm(y / is.response(f));
      }
      EXPECT_LT(std::sqrt(error / norm), 0.015) << rpm;
    }
  }
}

// A tool that is not what the follower believes is no mode of the sensor.
TEST(ModeFollower, AbstainsWhereTheForceModelIsWrong) {
  const double speed = units::radPerSecFromRpm(9000.0);
  const ModalModel sensor = ReferenceCase::exactSensor();
  ToolGeometry steeper = TOOL;
  steeper.helix = units::radFromDeg(34.0);
  const Engagement deeper{0.0, units::PI, 2.4e-3, 6e-5};
  const Engagement narrower{0.0, 0.9 * units::PI, 2e-3, 6e-5};
  for (ModeFollower follower : {ModeFollower(steeper, SLOT, 33, {}), ModeFollower(TOOL, deeper, 33, {}),
                                ModeFollower(TOOL, narrower, 33, {})}) {
    const auto update = follower.update(harmonics(sensor, speed, 33), 0.05, {sensor, sensor}, speed);
    if (!update) continue;
    EXPECT_EQ(update->sensor[0].modes.size(), 3u);
    EXPECT_EQ(update->sensor[1].modes.size(), 3u);
  }
}

TEST(ModeFollower, LeavesWhatFitsAlone) {
  const double speed = units::radPerSecFromRpm(9000.0);
  const ModalModel model_sensor = ReferenceCase::exactSensor();
  ModeFollower follower(TOOL, SLOT, 33, {});
  for (int look = 0; look < 3; ++look)
    EXPECT_FALSE(
        follower.update(harmonics(model_sensor, speed, 33), 0.05, {model_sensor, model_sensor}, speed)
            .has_value());
}

TEST(ModeFollower, GoesBackToTheTaps) {
  const double speed = units::radPerSecFromRpm(9000.0);
  const ModalModel model_sensor = ReferenceCase::exactSensor();
  ModalModel strayed = model_sensor;
  strayed.modes[0].frequency *= 1.03;
  ModeFollower follower(TOOL, SLOT, 33, {});
  ASSERT_FALSE(follower.update(harmonics(model_sensor, speed, 33), 0.05, {model_sensor, model_sensor}, speed)
                   .has_value());
  const auto update = follower.update(harmonics(model_sensor, speed, 33), 0.05, {strayed, strayed}, speed);
  ASSERT_TRUE(update.has_value());
  EXPECT_NEAR(update->sensor[0].modes[0].frequency, 1450.0, 1.5);
}

TEST(ModeFollower, RefusesImpossibleParameters) {
  ModeFollowerParameters parameters;
  parameters.misfit = 0.0;
  EXPECT_THROW(ModeFollower(TOOL, SLOT, 33, parameters), Error);
  EXPECT_THROW(ModeFollower(TOOL, SLOT, 0, {}), Error);
}

/// Issue: frozen at most a fifth of the raw error for 1 % of frequency error and half for 3 %; following back
/// under 3 % within 100 revolutions, and never worse than frozen.
class Following : public testing::Test {
 protected:
  struct Outcome {
    double raw = 0.0, frozen = 0.0, following = 0.0;
    std::size_t mode_updates = 0;
  };
  Outcome run(const ModalModel& is) {
    ReferenceCase reference;
    reference.spindle_speed = units::radPerSecFromRpm(21750.0);
    reference.duration = 0.42;
    const ModalModel model_sensor = reference.sensor;
    reference.sensor = is;
    const ReferenceRecord record = simulate(reference);
    CompensationParameters parameters;
    const auto frozen = runCompensation(reference, record, model_sensor, parameters);
    parameters.follow = true;
    Outcome outcome;
    const auto following =
        runCompensation(reference, record, model_sensor, parameters, &outcome.mode_updates);
    // From 100 revolutions after engagement on.
    const auto from = static_cast<std::size_t>((0.02 + 100.0 * 60.0 / 21750.0) * reference.sample_rate);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const auto error = [&](const std::vector<double>& force) {
        return bandError(force, record.truth[axis], reference.sample_rate, from, following[axis].size(),
                         5000.0);
      };
      outcome.raw = std::max(outcome.raw, error(record.measured[axis]));
      outcome.frozen = std::max(outcome.frozen, error(frozen[axis]));
      outcome.following = std::max(outcome.following, error(following[axis]));
    }
    return outcome;
  }
  static ModalModel scaled(double frequency, double damping) {
    ModalModel model = ReferenceCase::exactSensor();
    for (Mode& mode : model.modes) {
      mode.frequency *= frequency;
      mode.damping_ratio *= damping;
    }
    return model;
  }
};

TEST_F(Following, ExactModelStays) {
  const Outcome outcome = run(scaled(1.0, 1.0));
  EXPECT_EQ(outcome.mode_updates, 0u);
  EXPECT_EQ(outcome.following, outcome.frozen);
}

TEST_F(Following, OnePercent) {
  const Outcome outcome = run(scaled(1.01, 1.0));
  EXPECT_LT(outcome.frozen, 0.2 * outcome.raw);
  EXPECT_LT(outcome.following, 0.03);
}

TEST_F(Following, ThreePercent) {
  const Outcome outcome = run(scaled(1.03, 1.0));
  EXPECT_LT(outcome.frozen, 0.5 * outcome.raw);
  EXPECT_LT(outcome.following, 0.03);
}

TEST_F(Following, Damping) {
  const Outcome outcome = run(scaled(1.0, 1.3));
  EXPECT_LT(outcome.following, 0.03);
}

TEST_F(Following, AModeNobodyKnows) {
  const Outcome outcome = run(withOneMore());
  EXPECT_LT(outcome.following, 0.015);
}

}  // namespace
}  // namespace smartmill::kalman
