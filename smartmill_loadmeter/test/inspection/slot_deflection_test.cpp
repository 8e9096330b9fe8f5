// Width of a slot by the vibration of the tool: closed forms and a tool that is integrated in time.
#include "smartmill_loadmeter/inspection/slot_deflection.h"

#include <gtest/gtest.h>

#include <cmath>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

using units::PI;
using units::TWO_PI;

constexpr Uncertainty EXACT{0.0, 0.0, 0.0, 0.0, 0.0};
constexpr double CHIP = 60e-6, DEPTH = 2e-3;  // [m]
constexpr CuttingCoefficients K{950e6, 300e6, 0.0, 17e3, 21e3, 0.0};

CuttingCondition slot(int teeth, double helix) {
  CuttingCondition cut;
  cut.kind = CuttingCondition::Kind::cut;
  cut.tool = {teeth, 12e-3, helix, {}};
  cut.engagement = {0.0, PI, DEPTH, CHIP};
  cut.spindle_speed = units::radPerSecFromRpm(6000.0);
  return cut;
}

ModalModel modeOf(double frequency, double stiffness) {
  ModalModel tip;
  tip.modes.push_back({frequency, 0.03, 1.0 / stiffness});
  return tip;
}

// Three straight teeth: with one at 0 another cuts at 120 deg, with one at 180 deg another at 60 deg. Their
// radial forces differ by the chip there, c sin 60 deg; edge forces of the tooth at the wall begin and end
// there and are left out.
TEST(SlotDeflection, ofAStiffToolInClosedForm) {
  CuttingCoefficients k = K;
  k.kre = 0.0;
  const double stiffness = 10e6;  // [N/m]
  const Estimate w = slotWidening(slot(3, 0.0), k, 0.0, modeOf(1e7, stiffness), EXACT);
  EXPECT_NEAR(w.value, k.krc * CHIP * std::sin(PI / 3.0) * DEPTH / stiffness, 1e-8);
  EXPECT_EQ(w.std_dev, 0.0);
  // 3 % of the force and 5 % of the stiffness.
  Uncertainty uncertainty = EXACT;
  uncertainty.stiffness = 5.0;
  EXPECT_NEAR(slotWidening(slot(3, 0.0), k, 0.03, modeOf(1e7, stiffness), uncertainty).std_dev,
              w.value * std::hypot(0.03, 0.05), 1e-12);
}

TEST(SlotDeflection, anEvenNumberOfTeethShiftsBothWalls) {
  for (const int teeth : {2, 4}) {
    for (const double helix : {0.0, 0.6})
      EXPECT_NEAR(slotWidening(slot(teeth, helix), K, 0.0, modeOf(1200.0, 10e6), EXACT).value, 0.0, 1e-12);
  }
}

// y'' + 2 zeta w y' + w^2 y = w^2 F(t) / k by Runge-Kutta over 30 revolutions.
double integrated(const CuttingCondition& cut, double frequency, double stiffness) {
  const MechanisticForce force(cut.tool, K, cut.engagement);
  const double w = TWO_PI * frequency, zeta = 0.03, turn = TWO_PI / cut.spindle_speed;
  constexpr int STEPS = 2000;  // of a revolution
  const double h = turn / STEPS;
  double y = 0.0, v = 0.0;
  const auto slope = [&](double t, double at, double speed) {
    return w * w * (force.at(cut.spindle_speed * t).fy / stiffness - at) - 2.0 * zeta * w * speed;
  };
  std::vector<double> last(STEPS);
  for (int i = 0; i < 30 * STEPS; ++i) {
    const double t = h * i;
    last[static_cast<std::size_t>(i % STEPS)] = y;
    const double v1 = v, a1 = slope(t, y, v);
    const double v2 = v + 0.5 * h * a1, a2 = slope(t + 0.5 * h, y + 0.5 * h * v1, v2);
    const double v3 = v + 0.5 * h * a2, a3 = slope(t + 0.5 * h, y + 0.5 * h * v2, v3);
    const double v4 = v + h * a3, a4 = slope(t + h, y + h * v3, v4);
    y += h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4);
    v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
  }
  double widening = 0.0;
  constexpr int HEIGHTS = 200;
  for (int i = 0; i < HEIGHTS; ++i) {
    const double tip = cut.tool.lag() * DEPTH * (i + 0.5) / HEIGHTS;
    const auto at = [&](double angle) {
      return last[static_cast<std::size_t>(std::lround(angle / TWO_PI * STEPS)) % STEPS];
    };
    widening += (at(tip) - at(tip + PI)) / HEIGHTS;
  }
  return widening;
}

TEST(SlotDeflection, agreesWithTheIntegratedVibration) {
  for (const double frequency : {700.0, 1250.0, 2600.0}) {
    for (const int teeth : {3, 4}) {
      const CuttingCondition cut = slot(teeth, units::radFromDeg(35.0));
      const double truth = integrated(cut, frequency, 10e6);
      const double found = slotWidening(cut, K, 0.0, modeOf(frequency, 10e6), EXACT).value;
      EXPECT_NEAR(found, truth, 0.02 * std::abs(truth) + 5e-9) << frequency << " Hz, " << teeth << " teeth";
      std::printf("%.0f Hz, %d teeth: widening %.3f um, integrated %.3f um\n", frequency, teeth, 1e6 * found,
                  1e6 * truth);
    }
  }
}

}  // namespace
}  // namespace smartmill::loadmeter
