#include "smartmill_hammer/analysis/idle_spindle.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

constexpr double RATE = 10000.0, TIME = 1.5, SETTLE = 0.2;
constexpr std::size_t BLOCK = 100;

/// A spindle in air: m e w^2 on a sensor of one mode (amplification 1 / (1 - r^2 + 2 i zeta r), a closed
/// form), plus 30 N at twice the spindle frequency and noise; a load meter of w (c + v w) with noise.
struct Plant {
  std::complex<double> unbalance;           // [kg m]
  double coulomb = 3e-6, viscous = 2.5e-8;  // of full scale
  std::mt19937 random{1};
  std::map<std::string, ModalModel> sensors;

  Plant() {
    ModalModel one;
    one.modes = {{930.0, 0.02, 1.0}};
    sensors["fx"] = one;
  }

  AirCutRecord runAt(const std::vector<double>& speeds) {
    IdleSpindlePipeline idle(0.05);
    double time = 0.0;
    std::uint64_t index = 0;
    std::normal_distribution<double> normal;
    for (const double w : speeds) {
      idle.push(CuttingCondition{time, CuttingCondition::Kind::air, "air", "", "T1", {}, {}, {}});
      const double r = w / units::TWO_PI / 930.0;
      const std::complex<double> line = unbalance * w * w / std::complex<double>(1.0 - r * r, 0.04 * r);
      for (double until = time + TIME; time < until;) {
        const double speed =
            std::min(w, w * (1.0 - 0.5 * std::max(0.0, SETTLE - (time - until + TIME)) / SETTLE));
        SampleBlock block{time, RATE, index, {"fx", "fz"}, {"N", "N"}, {}};
        for (std::size_t i = 0; i < BLOCK; ++i) {
          const double angle = w * block.timeOf(i);
          block.samples.push_back((line * std::polar(1.0, angle)).real() +
                                  30.0 * std::cos(2.0 * angle + 1.0) + 5.0 + 2.0 * normal(random));
          block.samples.push_back(normal(random));
        }
        idle.push(SpindleAngle{time, std::fmod(w * time, units::TWO_PI), speed});
        idle.push(block);
        idle.push(
            LoadSample{time, speed * (coulomb + viscous * speed) + 2e-4 * normal(random), speed, {}, {}});
        time += BLOCK / RATE;
        index += BLOCK;
      }
      // A cut with engagement is not evaluated.
      idle.push(CuttingCondition{time, CuttingCondition::Kind::cut, "cut", "", "T1", {}, {}, {}});
      idle.push(SpindleAngle{time, 0.0, w});
      idle.push(
          SampleBlock{time, RATE, index, {"fx", "fz"}, {"N", "N"}, std::vector<double>(2 * BLOCK, 900.0)});
      time += BLOCK / RATE;
      index += BLOCK;
    }
    idle.finish();
    const auto found = idle.records().find("T1");
    return found == idle.records().end() ? AirCutRecord() : found->second;
  }
};

const std::vector<double> SPEEDS = {314.2, 628.3, 942.5, 1256.6};

TEST(IdleSpindle, FindsUnbalanceAndFriction) {
  Plant plant;
  plant.unbalance = std::polar(20e-6, 0.7);
  const AirCutRecord record = plant.runAt(SPEEDS);
  ASSERT_EQ(record.forces.count("fx"), 1u);
  EXPECT_EQ(record.forces.count("fz"), 0u);
  ASSERT_EQ(record.forces.at("fx").size(), SPEEDS.size());
  const Unbalance u = unbalanceOf(record.forces.at("fx"), plant.sensors["fx"]);
  EXPECT_NEAR(std::abs(u.value - plant.unbalance), 0.0, 4.0 * u.std);
  EXPECT_LT(u.std, 0.005 * 20e-6);
  const auto friction = frictionOf(record.loads);
  ASSERT_TRUE(friction.has_value());
  EXPECT_NEAR(friction->viscous, 2.5e-8, 4.0 * friction->viscous_std);
  EXPECT_NEAR(friction->coulomb, 3e-6, 4.0 * friction->coulomb_std);
  EXPECT_LT(friction->viscous_std, 0.02 * 2.5e-8);
  EXPECT_FALSE(frictionOf(plant.runAt({628.3}).loads).has_value());
}

// By the standard deviations alone: 60 unchanged pairs of sessions show no drift (five to nine quantities
// each, 4 standard deviations); 5 % more viscous friction, or an unbalance changed by 2 of 20 g mm, is found.
TEST(IdleSpindle, DistinguishesDriftFromChance) {
  Plant plant;
  plant.unbalance = std::polar(20e-6, 0.7);
  constexpr HealthAllowance NONE{0.0, 0.0, 0.0, 0.0, 0.0};
  const AirCutRecord first = plant.runAt(SPEEDS);
  const auto drift = [&](const HealthAllowance& allowance) {
    return driftText(airCutChanges(first, plant.runAt(SPEEDS), plant.sensors, allowance));
  };
  int false_alarms = 0;
  for (int i = 0; i < 60; ++i) false_alarms += !drift(NONE).empty();
  EXPECT_LE(false_alarms, 2);
  plant.viscous *= 1.05;
  EXPECT_NE(drift(NONE).find("load in air"), std::string::npos);
  EXPECT_TRUE(drift({}).empty());
  plant.viscous *= 1.3;
  EXPECT_FALSE(drift({}).empty());
  plant.viscous = 2.5e-8;
  plant.unbalance += std::polar(2e-6, 2.2);
  EXPECT_NE(drift(NONE).find("unbalance"), std::string::npos);
  EXPECT_TRUE(drift({}).empty());
  plant.unbalance = std::polar(20e-6, 2.2);  // the same size
  EXPECT_NE(drift({}).find("unbalance"), std::string::npos);
}

}  // namespace
}  // namespace smartmill::hammer
