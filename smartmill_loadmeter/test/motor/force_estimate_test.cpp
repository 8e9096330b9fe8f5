#include "smartmill_loadmeter/motor/force_estimate.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/motor/force_record.h"

namespace smartmill::loadmeter {
namespace {

// Published milling coefficients, N/mm2 and N/mm: Ktc Krc Kac Kte Kre Kae.
const std::vector<CuttingCoefficients> METALS{
    {796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3},    // Al 7075 (Altintas, Manufacturing Automation)
    {1844e6, 513e6, 348e6, 24.0e3, 43.0e3, 3.0e3},   // Ti6Al4V (Budak, Altintas, Armarego 1996)
    {2172e6, 849e6, 726e6, 17.3e3, 7.8e3, 6.6e3},    // AISI 1045
    {1319e6, 789e6, 51e6, 23.5e3, 25.0e3, 2.0e3},    // GGG 70
    {959e6, 251e6, 146e6, 15.8e3, 19.4e3, 18.2e3}};  // slot_6000, measured

struct Case {
  CutMeasurements measurements;
  std::array<double, 3> mean{}, rms{};
  double torque = 0.0;
};

/// Cut with measurement errors of the stated standard deviations. @param axes with motion and motor currents
Case draw(std::mt19937_64& random, const std::vector<std::size_t>& axes, bool sensor) {
  std::normal_distribution<double> normal;
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  Case one;
  CutMeasurements& r = one.measurements;
  r.tool.teeth = 2 + static_cast<int>(uniform(0.0, 2.999));
  r.tool.diameter = uniform(10e-3, 20e-3);
  r.tool.helix = uniform(0.3, 0.7);
  const bool slot = uniform(0.0, 1.0) < 0.5;
  r.engagement = {slot ? 0.0 : uniform(1.2, 2.2), units::PI, uniform(1e-3, 4e-3), uniform(0.04e-3, 0.2e-3)};
  r.heading = uniform(-3.0, 3.0);
  CuttingCoefficients k = METALS[random() % METALS.size()];
  for (double* value : {&k.ktc, &k.krc, &k.kac, &k.kte, &k.kre, &k.kae}) *value *= 1.0 + 0.1 * normal(random);
  const MechanisticForce force(r.tool, k, r.engagement);
  std::array<double, 3> square{};
  constexpr int STEPS = 720;
  for (int i = 0; i < STEPS; ++i) {
    const CuttingForce f = force.at(units::TWO_PI * i / STEPS);
    const std::array<double, 3> at{std::cos(r.heading) * f.fx - std::sin(r.heading) * f.fy,
                                   std::sin(r.heading) * f.fx + std::cos(r.heading) * f.fy, f.fz};
    for (std::size_t a = 0; a < 3; ++a) {
      one.mean[a] += at[a] / STEPS;
      square[a] += at[a] * at[a] / STEPS;
    }
    one.torque += f.torque / STEPS;
  }
  for (std::size_t a = 0; a < 3; ++a) one.rms[a] = std::sqrt(square[a] - one.mean[a] * one.mean[a]);
  const auto off = [&](double value, double share, double size, double noise) {
    return Estimate{value + share * size * normal(random) + noise * normal(random), noise};
  };
  const double both = std::hypot(0.02, 0.03), of_sensor = std::hypot(0.02, 0.02);
  r.load_torque = off(one.torque, 0.02, std::abs(one.torque), 0.02);
  if (!axes.empty()) r.motor_torque = off(one.torque, both, std::abs(one.torque), 0.05);
  for (const std::size_t a : axes) r.motor_force[a] = off(one.mean[a], both, std::abs(one.mean[a]), 8.0);
  if (sensor) {
    double most = 0.0, most_rms = 0.0;
    for (std::size_t a = 0; a < 3; ++a) {
      most = std::max(most, std::abs(one.mean[a]));
      most_rms = std::max(most_rms, one.rms[a]);
    }
    for (std::size_t a = 0; a < 3; ++a) {
      r.sensor_force[a] = off(one.mean[a], of_sensor, most, std::hypot(1.0, 2.0));
      r.sensor_force[a]->std_dev = 1.0;
      r.sensor_rms[a] = off(one.rms[a], of_sensor, most_rms, 1.0);
    }
  }
  return one;
}

/// Share of 300 cuts within 1.96 standard deviations, and the median relative standard deviation.
struct Calibration {
  std::array<double, 3> mean{}, rms{};
  double torque = 0.0, chi_square = 0.0;
  std::array<double, 3> deviation{};  // [1] median of std over the whole force
};

Calibration calibrationOf(const std::vector<std::size_t>& axes, bool sensor, unsigned seed) {
  constexpr int COUNT = 300;
  std::mt19937_64 random(seed);
  Calibration h;
  std::array<std::vector<double>, 3> deviations;
  for (int i = 0; i < COUNT; ++i) {
    const Case one = draw(random, axes, sensor);
    const ForceEstimate found = estimateForce(one.measurements, {});
    const double whole = std::hypot(std::hypot(one.mean[0], one.mean[1]), one.mean[2]);
    for (std::size_t a = 0; a < 3; ++a) {
      h.mean[a] +=
          (std::abs(found.mean[a].value - one.mean[a]) < 1.96 * found.mean[a].std_dev) / double{COUNT};
      h.rms[a] += (std::abs(found.rms[a].value - one.rms[a]) < 1.96 * found.rms[a].std_dev) / double{COUNT};
      deviations[a].push_back(found.mean[a].std_dev / whole);
    }
    h.torque += (std::abs(found.torque.value - one.torque) < 1.96 * found.torque.std_dev) / double{COUNT};
    h.chi_square += found.chi_square / COUNT;
  }
  for (std::size_t a = 0; a < 3; ++a) {
    std::nth_element(deviations[a].begin(), deviations[a].begin() + COUNT / 2, deviations[a].end());
    h.deviation[a] = deviations[a][COUNT / 2];
  }
  return h;
}

// Coverage from both sides: 95 % nominal; with 300 cuts three standard deviations are 3.8 %, and the metals'
// ratios differ from the prior.
TEST(ForceEstimate, standardDeviationsAreCalibrated) {
  struct Set {
    const char* name;
    std::vector<std::size_t> axes;
    bool sensor;
  };
  for (const Set& set : {Set{"load meter", {}, false}, Set{"and motor X", {0}, false},
                         Set{"and motors X, Y", {0, 1}, false}, Set{"and sensor", {0, 1}, true}}) {
    const Calibration h = calibrationOf(set.axes, set.sensor, 7);
    std::printf(
        "%-16s mean %.3f %.3f %.3f rms %.3f %.3f %.3f torque %.3f surprise %.2f; std %.3f %.3f %.3f\n",
        set.name, h.mean[0], h.mean[1], h.mean[2], h.rms[0], h.rms[1], h.rms[2], h.torque, h.chi_square,
        h.deviation[0], h.deviation[1], h.deviation[2]);
    for (std::size_t a = 0; a < 3; ++a) {
      EXPECT_GT(h.mean[a], 0.90) << set.name << " mean " << a;
      EXPECT_LT(h.mean[a], 0.995) << set.name << " mean " << a;
      EXPECT_GT(h.rms[a], 0.90) << set.name << " rms " << a;
      EXPECT_LT(h.rms[a], 0.995) << set.name << " rms " << a;
    }
  }
}

// Measured components are more certain than others.
TEST(ForceEstimate, everySensorReducesTheUncertainty) {
  const Calibration alone = calibrationOf({}, false, 3), motors = calibrationOf({0, 1}, false, 3),
                    all = calibrationOf({0, 1}, true, 3);
  EXPECT_LT(motors.deviation[0], 0.7 * alone.deviation[0]);
  EXPECT_LT(motors.deviation[1], 0.7 * alone.deviation[1]);
  EXPECT_LT(all.deviation[2], 0.6 * motors.deviation[2]);
}

TEST(ForceEstimate, disagreeingSensorsIncreaseChiSquare) {
  std::mt19937_64 random(5);
  Case one = draw(random, {0, 1}, true);
  EXPECT_LT(estimateForce(one.measurements, {}).chi_square, 3.0);
  for (auto& force : one.measurements.sensor_force) force->value *= 1.5;
  EXPECT_GT(estimateForce(one.measurements, {}).chi_square, 5.0);
}

// A cut that pulls an axis along has the same range as one that opposes it more: the other measurements
// decide.
TEST(ForceEstimate, aRangeHasNoSign) {
  std::mt19937_64 random(11);
  int near = 0;
  for (int i = 0; i < 40; ++i) {
    Case one = draw(random, {0, 1}, false);
    for (std::size_t a = 0; a < 2; ++a) {
      // Friction of 150 N either way.
      one.measurements.motor_other[a] = one.measurements.motor_force[a];
      const bool on = one.mean[a] > 0.0;
      const double wrong = -one.measurements.motor_force[a]->value + (on ? -300.0 : 300.0);
      (i % 2 ? one.measurements.motor_force : one.measurements.motor_other)[a]->value = wrong;
    }
    const ForceEstimate found = estimateForce(one.measurements, {});
    near += std::abs(found.mean[0].value - one.mean[0]) < 3.0 * found.mean[0].std_dev &&
            std::abs(found.mean[1].value - one.mean[1]) < 3.0 * found.mean[1].std_dev;
  }
  EXPECT_GE(near, 38);
}

TEST(ForceEstimate, refusesMissingAndInvalidMeasurements) {
  std::mt19937_64 random(5);
  Case one = draw(random, {0}, false);
  CutMeasurements none = one.measurements;
  none.load_torque.reset();
  none.motor_torque.reset();
  none.motor_force = {};
  const auto error = [](const CutMeasurements& r) {
    try {
      estimateForce(r, {});
    } catch (const std::exception& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(error(none), "force of a cut: no measurement");
  one.measurements.motor_force[0]->std_dev = std::nan("");
  EXPECT_EQ(error(one.measurements),
            "force of a cut: measurement of motor_x: expected a finite value and a standard deviation");
}

// Sine of 30 N about 50 N with a zero of 20 N and noise of 5 N.
TEST(ForceRecord, meanAndVariationWithoutZeroAndNoise) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0.0, 5.0);
  const auto record = [&](double mean, double amplitude) {
    ForceRecord made;
    for (int b = 0; b < 200; ++b) {
      ForceBlock block;
      block.stamp = 0.01 * b;
      block.sample_rate = 10000.0;
      block.status = ForceBlock::Status::compensated;
      for (auto& axis : block.force) {
        for (int i = 0; i < 100; ++i)
          axis.push_back(20.0 + mean +
                         amplitude * std::sin(units::TWO_PI * 173.0 * (block.stamp + i * 1e-4)) +
                         normal(random));
      }
      made.add(block);
    }
    return made.measurement();
  };
  const auto air = record(0.0, 0.0), cut = record(50.0, 30.0);
  ASSERT_TRUE(air && cut);
  for (std::size_t a = 0; a < 3; ++a) {
    EXPECT_NEAR(cut->meanAbove(air, a).value, 50.0, 0.6);
    ASSERT_TRUE(cut->rmsAbove(air, a));
    EXPECT_NEAR(cut->rmsAbove(air, a)->value, 30.0 / std::sqrt(2.0), 0.3);
    EXPECT_FALSE(air->rmsAbove(air, a));
  }
}

/// Turning: workpiece of 30 mm radius, 300 N tangential by the torque.
CutMeasurements turning(double heading) {
  CutMeasurements r;
  r.tool.diameter = 0.06;
  r.engagement.axial_depth = 1e-3;
  r.engagement.feed_per_tooth = 2e-4;
  r.heading = heading;
  r.spindle_speed = 60.0;
  r.motor_torque = Estimate{9.0, 0.1};
  return r;
}

// Ft = T / r acts along the cutting speed (+Y), the feed force against the feed. The passive force has no
// motor that moves: its value and its larger deviation are those of the prior, and it points away from the
// workpiece.
TEST(ForceEstimate, turningCutsHaveTangentialFeedAndPassiveForce) {
  CutMeasurements longitudinal = turning(-0.5 * units::PI);
  longitudinal.motor_force[2] = Estimate{150.0, 3.0};
  const ForceEstimateParameters p;
  const ForceEstimate along = estimateForce(longitudinal, p);
  const auto deviation = [&](double value, double own) {
    return std::hypot(own, std::hypot(p.model_error, p.motor_error) * value);
  };
  EXPECT_NEAR(along.mean[1].value, 300.0, deviation(300.0, 0.1 / 0.03));
  EXPECT_NEAR(along.mean[2].value, 150.0, deviation(150.0, 3.0));
  EXPECT_LE(along.mean[2].std_dev, deviation(150.0, 3.0));
  // About 0.2 +- 0.11 of the tangential force, as Kac of Ktc.
  EXPECT_NEAR(along.mean[0].value, 60.0, 30.0);
  EXPECT_GT(along.mean[0].std_dev, 0.09 * 300.0);
  for (const Estimate& rms : along.rms) EXPECT_TRUE(std::isnan(rms.value));
  EXPECT_TRUE(along.lines.empty());
  EXPECT_EQ(along.text().find("nan"), std::string::npos) << along.text();

  CutMeasurements facing = turning(units::PI);
  facing.motor_force[0] = Estimate{150.0, 3.0};
  const ForceEstimate inwards = estimateForce(facing, p);
  EXPECT_NEAR(inwards.mean[0].value, along.mean[2].value, 1e-3);
  EXPECT_NEAR(inwards.mean[2].value, along.mean[0].value, 1e-3);
  EXPECT_NEAR(inwards.mean[1].value, along.mean[1].value, 1e-3);

  // Taper of 30 degrees: both axes move, and the two forces determine feed and passive force, here 200 N and
  // 80 N.
  const double c = std::cos(units::PI / 6.0), s = std::sin(units::PI / 6.0);
  CutMeasurements taper = turning(std::atan2(-c, -s));
  taper.motor_force[0] = Estimate{200.0 * s + 80.0 * c, 3.0};
  taper.motor_force[2] = Estimate{200.0 * c - 80.0 * s, 3.0};
  const ForceEstimate both = estimateForce(taper, p);
  EXPECT_NEAR(both.mean[0].value, 200.0 * s + 80.0 * c, 2.0 * both.mean[0].std_dev);
  EXPECT_NEAR(both.mean[2].value, 200.0 * c - 80.0 * s, 2.0 * both.mean[2].std_dev);
  EXPECT_LT(both.mean[0].std_dev, 8.0);
}

}  // namespace
}  // namespace smartmill::loadmeter
