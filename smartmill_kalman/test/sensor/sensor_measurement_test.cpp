#include "smartmill_kalman/sensor/sensor_measurement.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/tap_rig.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"

namespace smartmill::kalman {
namespace {

constexpr double START = 1.75e9;  // [s]

MeasureFrfGoal goal(const std::string& direction, int hits, int modes) {
  MeasureFrfGoal g;
  g.stamp = START + 0.1;
  g.point = POINT_FORCE_SENSOR;
  g.direction = direction;
  g.hits = hits;
  g.modes = modes;
  return g;
}

/// Rig and class in a loop: the rig's hammer executes the strike commands.
class Loop {
 public:
  explicit Loop(const ModalModel& truth = dynamometer(), std::uint32_t seed = 1, TapParameters taps = {})
      : rig(TapRig::diagonal(truth), START, seed),
        pipeline({}, taps, ForceSensor(), 0.05,
                 {{{}, [this](const ForceBlock& c) { forces.push_back(c); }},
                  [this](const StrikeCommand& c) {
                    ++strikes;
                    if (automatic_hammer) rig.strike(static_cast<std::size_t>(c.direction[0] - 'x'));
                  },
                  [this](const TapFeedback& f) { said.push_back(f.stage); },
                  [this](const SensorResult& r) { results.push_back(r); }}) {}

  void run(double seconds) {
    const double end = rig.now() + seconds;
    while (rig.now() < end && (results.empty() || go_on)) {
      TapRig::Blocks blocks = rig.next();
      if (spoil) spoil(blocks);
      pipeline.push(blocks.angle);
      pipeline.pushHammer(blocks.hammer);
      pipeline.push(blocks.sensor);
    }
  }
  /// @return the only result.
  SensorResult measure(const MeasureFrfGoal& g) {
    pipeline.push(g);
    run(120.0);
    if (results.size() != 1) throw Error("no result");
    return results.front();
  }

  TapRig rig;
  bool automatic_hammer = true, go_on = false;
  std::function<void(TapRig::Blocks&)> spoil;
  int strikes = 0;
  std::vector<std::string> said;
  std::vector<SensorResult> results;
  std::vector<ForceBlock> forces;
  CompensationPipeline pipeline;
};

// Closed form: one mode at 930 Hz, 3 %. 1 N of noise with hits of 300 N.
TEST(SensorMeasurement, findsTheModeFromThreeTaps) {
  for (const char* direction : {"x", "y", "z"}) {
    Loop loop;
    const SensorResult r = loop.measure(goal(direction, 3, 0));
    ASSERT_EQ(r.code, FrfCode::ok) << r.message;
    ASSERT_EQ(r.modes.model.modes.size(), 1u);
    const Mode& mode = r.modes.model.modes[0];
    EXPECT_NEAR(mode.frequency, 930.0, 0.002 * 930.0);
    EXPECT_NEAR(mode.damping_ratio, 0.03, 0.03 * 0.03);
    EXPECT_NEAR(mode.gain, 0.9, 0.02);
    EXPECT_NEAR(r.modes.model.staticGain(), 1.0, 1e-9);
    EXPECT_NEAR(r.noise_rms, 1.0, 0.1);
    EXPECT_NEAR(r.static_gain, 1.0, 4.0 * r.static_gain_std + 0.01);  // dynamics below 100 Hz: 1 %
    EXPECT_EQ(r.frf.direction, direction);
    EXPECT_EQ(r.frf.point, POINT_FORCE_SENSOR);
    EXPECT_EQ(r.frf.frf.unit, "1");
    EXPECT_EQ(r.frf.frf.averages, 3);
    EXPECT_GT(r.frf.frf.coherence[186], 0.99);  // 930 Hz / 5 Hz
    EXPECT_EQ(loop.strikes, 3);
  }
}

TEST(SensorMeasurement, ABlowFromTheOtherSideIsTurned) {
  Loop loop;
  loop.rig.peak = -300.0;
  const SensorResult r = loop.measure(goal("y", 3, 1));
  ASSERT_EQ(r.code, FrfCode::ok) << r.message;
  EXPECT_LT(r.static_gain, 0.0);
  EXPECT_NEAR(r.modes.model.modes[0].frequency, 930.0, 0.002 * 930.0);
  EXPECT_NEAR(r.modes.model.modes[0].gain, 0.9, 0.02);
}

// By their noise alone: the allowance for systematic errors, which this rig has not, is
// left out. Aliasing of the sampled half sine biases by less than the noise here.
TEST(SensorMeasurement, StandardDeviationsAreHonest) {
  Coverage frequency, damping, gain;
  TapParameters taps;
  taps.record_length = 0.1;
  taps.systematic = 0.0;
  taps.rest_time = 0.02;
  for (std::uint32_t run = 0; run < Coverage::RUNS; ++run) {
    Loop loop(dynamometer(), 100 + run, taps);
    loop.rig.noise = 3.0;
    const SensorResult r = loop.measure(goal("x", 4, 1));
    ASSERT_EQ(r.code, FrfCode::ok) << r.message;
    const Mode& mode = r.modes.model.modes[0];
    frequency.add(mode.frequency - 930.0, mode.frequency_std);
    damping.add(mode.damping_ratio - 0.03, mode.damping_ratio_std);
    gain.add(mode.gain - 0.9, mode.gain_std);
  }
  EXPECT_TRUE(frequency.isCalibrated());
  EXPECT_TRUE(damping.isCalibrated());
  EXPECT_TRUE(gain.isCalibrated());
}

// More rejected hits than max_bad_hits in all, but not in a row.
TEST(SensorMeasurement, GoesOnWhenEverySecondHitIsRejected) {
  TapParameters taps;
  taps.max_bad_hits = 1;
  Loop loop(dynamometer(), 1, taps);
  loop.spoil = [&loop](TapRig::Blocks&) { loop.rig.peak = loop.strikes % 2 == 1 ? 14.0 : 300.0; };
  const SensorResult r = loop.measure(goal("x", 4, 1));
  EXPECT_EQ(r.code, FrfCode::ok) << r.message;
  EXPECT_EQ(loop.strikes, 8);
}

TEST(SensorMeasurement, NamesWhatIsWrong) {
  TapParameters taps;
  taps.max_bad_hits = 1;
  taps.strike_timeout = 0.5;
  {
    Loop loop(dynamometer(), 1, taps);
    loop.automatic_hammer = false;
    const SensorResult r = loop.measure(goal("x", 3, 0));
    EXPECT_EQ(r.code, FrfCode::no_hit);
    EXPECT_EQ(loop.strikes, 2);
  }
  {
    Loop loop(dynamometer(), 1, taps);
    loop.rig.peak = 14.0;
    EXPECT_EQ(loop.measure(goal("x", 3, 0)).code, FrfCode::no_hit);  // weak
  }
  {
    Loop loop(dynamometer(), 1, taps);
    loop.spoil = [](TapRig::Blocks& b) { b.sensor.samples[300] = NAN; };
    EXPECT_EQ(loop.measure(goal("x", 3, 0)).code, FrfCode::bad_data);
  }
  {
    Loop loop(dynamometer(), 1, taps);
    loop.spoil = [](TapRig::Blocks& b) {
      for (double& f : b.sensor.samples) f = std::min(f, 50.0);
    };
    const SensorResult r = loop.measure(goal("x", 3, 0));
    EXPECT_EQ(r.code, FrfCode::bad_data);
    EXPECT_NE(r.message.find("clipped"), std::string::npos) << r.message;
  }
  {
    Loop loop(dynamometer(), 1, taps);  // a hammer whose sensitivity is half of what is set
    loop.spoil = [](TapRig::Blocks& b) {
      for (double& f : b.hammer.samples) f *= 0.5;
    };
    const SensorResult r = loop.measure(goal("x", 3, 0));
    EXPECT_EQ(r.code, FrfCode::bad_data);
    EXPECT_NE(r.message.find("static gain 2.0"), std::string::npos) << r.message;
  }
  {
    Loop loop(dynamometer(), 1, taps);  // lost blocks of the hammer
    loop.spoil = [](TapRig::Blocks& b) { b.hammer.first_index += 1000000; };
    EXPECT_EQ(loop.measure(goal("x", 3, 0)).code, FrfCode::bad_data);
  }
  {
    Loop loop(dynamometer(), 1, taps);  // an instrument of its own: its count began with the same sample
    loop.spoil = [](TapRig::Blocks& b) { b.hammer.stamp += 0.1e-3; };
    const SensorResult r = loop.measure(goal("x", 3, 0));
    EXPECT_EQ(r.code, FrfCode::bad_data);
    EXPECT_NE(r.message.find("stamps of the same running index differ by 0.10 ms"), std::string::npos)
        << r.message;
  }
  EXPECT_EQ(Loop().measure(goal("u", 3, 0)).code, FrfCode::bad_goal);
  EXPECT_EQ(Loop().measure(goal("x", 0, 0)).code, FrfCode::bad_goal);
  MeasureFrfGoal tip = goal("x", 3, 0);
  tip.point = POINT_TOOL_TIP;
  EXPECT_EQ(Loop().measure(tip).code, FrfCode::bad_goal);
}

TEST(SensorMeasurement, CancelsAndRefusesASecondGoal) {
  Loop loop;
  std::vector<bool> taken;
  loop.pipeline.push(goal("x", 50, 0), [&](bool free) {
    taken.push_back(free);
    return true;
  });
  loop.run(1.0);
  loop.pipeline.push(goal("y", 3, 0), [&](bool free) {
    taken.push_back(free);
    return true;
  });
  loop.run(1.0);
  ASSERT_TRUE(loop.results.empty());
  loop.pipeline.event([](SensorMeasurement& m) { m.hitByHand(); });
  loop.run(0.2);
  EXPECT_NE(std::find(loop.said.begin(), loop.said.end(), "hit the workpiece by hand in x"), loop.said.end());
  loop.pipeline.event([](SensorMeasurement& m) { m.end(FrfCode::cancelled, "cancelled"); });
  loop.run(0.2);
  ASSERT_EQ(loop.results.size(), 1u);
  EXPECT_EQ(loop.results[0].code, FrfCode::cancelled);
  EXPECT_EQ(taken, (std::vector<bool>{true, false}));
}

// The model has an ideal sensor; its modes are known from the tap test only. Slot at 9000 rpm, 4 flutes: the
// second harmonic of 600 Hz is on the flank of the mode.
TEST(SensorMeasurement, IdentifiedModesServeFromThenOn) {
  Loop loop;
  loop.go_on = true;
  for (const char* direction : {"x", "y"}) {
    MeasureFrfGoal g = goal(direction, 5, 0);
    g.stamp = loop.rig.now() + 0.05;
    loop.pipeline.push(g);
    loop.run(4.0);
  }
  ASSERT_EQ(loop.results.size(), 2u);
  const double speed = units::radPerSecFromRpm(9000.0);
  const MechanisticForce process({4, 19.05e-3, units::radFromDeg(30.0), {}},
                                 {796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3}, {0.0, units::PI, 2e-3, 6e-5});
  loop.rig.cut = [&](double t) {
    const CuttingForce f = process.at(speed * t);
    return std::array<double, 3>{f.fx, f.fy, f.fz};
  };
  loop.rig.speed = speed;
  loop.run(1.0);
  loop.pipeline.flush();
  std::array<double, 3> error{}, norm{};
  for (const ForceBlock& block : loop.forces) {
    if (block.stamp < loop.rig.now() - 0.5) continue;
    for (std::size_t i = 0; i < TapRig::BLOCK; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double truth = loop.rig.forces[block.first_index + i][axis];
        error[axis] += std::pow(block.force[axis][i] - truth, 2);
        norm[axis] += truth * truth;
      }
    }
  }
  std::printf("error x %.4f y %.4f z (not tapped) %.4f\n", std::sqrt(error[0] / norm[0]),
              std::sqrt(error[1] / norm[1]), std::sqrt(error[2] / norm[2]));
  // The residual is noise of 1 N in a force of some 30 N.
  EXPECT_LT(std::sqrt(error[0] / norm[0]), 0.05);
  EXPECT_LT(std::sqrt(error[1] / norm[1]), 0.05);
  EXPECT_GT(std::sqrt(error[2] / norm[2]), 0.05);  // ideal by the model, not compensated
}

TEST(SensorMeasurement, RefusesParametersOutOfRange) {
  TapParameters taps;
  taps.weak_force = 1.0;
  EXPECT_THROW(SensorMeasurement{taps}, Error);
}

}  // namespace
}  // namespace smartmill::kalman
