// From hits to the tip: solenoid crosstalk, gains at known poles, shifts of modes, first-order modes of the
// tool.

#include <cmath>
#include <complex>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "../../src/analysis/tool_in_holder.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/analysis/pole_gains.h"
#include "smartmill_hammer/analysis/solenoid_crosstalk.h"

namespace smartmill::hammer {
namespace {

using Complex = std::complex<double>;

constexpr double RATE = 25600.0;
constexpr std::size_t BEFORE = 256, SAMPLES = 2560;

/// A half sine of 0.3 ms and its decaying response; the current adds to both channels until contact and
/// decays with 2 ms.
Hit hitWith(double coil_force, double coil_volt, double noise, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Hit hit;
  hit.sample_rate = RATE;
  hit.pre_trigger = BEFORE;
  for (std::size_t i = 0; i < SAMPLES; ++i) {
    const double t = (static_cast<double>(i) - static_cast<double>(BEFORE)) / RATE;
    const double current = t < 0.0 ? 1.0 : std::exp(-t / 2e-3);
    const double pulse = t > 0.0 && t < 3e-4 ? 150.0 * std::sin(units::PI * t / 3e-4) : 0.0;
    const double ring = t > 0.0 ? std::exp(-120.0 * t) * std::sin(units::TWO_PI * 900.0 * t) : 0.0;
    hit.force.push_back(0.4 + pulse + coil_force * current + noise * normal(random));
    hit.response.push_back(-1.2 - ring + coil_volt * current + 2e-3 * noise * normal(random));
  }
  return hit;
}

double largestDifference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

TEST(SolenoidCrosstalk, IsSubtractedFromBothChannels) {
  for (const double sign : {1.0, -1.0}) {
    const Hit clean = hitWith(0.0, 0.0, 0.05, 1);
    Hit hit = hitWith(sign * 5.0, -sign * 0.03, 0.05, 1);
    removeSolenoidCrosstalk(hit, 0.05);
    // The time constant is found in steps of 10 %, the contact to one sample.
    EXPECT_LT(largestDifference(hit.force, clean.force), 0.06 * 5.0) << sign;
    EXPECT_LT(largestDifference(hit.response, clean.response), 0.06 * 0.03) << sign;
  }
}

TEST(SolenoidCrosstalk, OtherLevelsAreUnchanged) {
  const Hit clean = hitWith(0.0, 0.0, 0.05, 2);
  Hit hit = clean;
  removeSolenoidCrosstalk(hit, 0.05);
  EXPECT_LT(largestDifference(hit.force, clean.force), 0.05);  // of noise at most
  const Hit large = hitWith(12.0, 0.0, 0.05, 2);               // 8 % of the peak
  hit = large;
  removeSolenoidCrosstalk(hit, 0.05);
  EXPECT_EQ(hit.force, large.force);
  Hit drifted = clean;  // by 8 % towards the end: no decay
  for (std::size_t i = BEFORE; i < SAMPLES; ++i)
    drifted.force[i] += 12.0 * static_cast<double>(i - BEFORE) / static_cast<double>(SAMPLES - BEFORE);
  hit = drifted;
  removeSolenoidCrosstalk(hit, 0.1);
  EXPECT_EQ(hit.force, drifted.force);
  hit = drifted;
  removeSolenoidCrosstalk(hit, 0.0);
  EXPECT_EQ(hit.response, drifted.response);
}

FrequencyResponse responseOf(const ModalModel& model) {
  FrequencyResponse frf;
  frf.unit = "m/N";
  for (double f = 10.0; f <= 4000.0; f += 10.0) {
    frf.frequency.push_back(f);
    frf.value.push_back(model.response(f));
    frf.std_dev.push_back(1e-10);
  }
  return frf;
}

ModalModel twoModes() {
  ModalModel model;
  model.modes = {{800.0, 0.03, 2e-8, 0.1, 1e-4, 1e-10}, {1900.0, 0.02, -6e-9, 0.1, 1e-4, 1e-10}};
  model.direct = 1e-9;
  return model;
}

TEST(PoleGains, AreThoseOfTheFrf) {
  const ModalModel model = twoModes();
  ModalModel poles = model;
  poles.modes[0].gain = poles.modes[1].gain = 1e-8;
  const ModalModel found = gainsAtPoles(responseOf(model), poles, 100.0, 3000.0);
  EXPECT_NEAR(found.modes[0].gain, 2e-8, 1e-14);
  EXPECT_NEAR(found.modes[1].gain, -6e-9, 1e-14);
  EXPECT_NEAR(found.direct, 1e-9, 1e-14);
  EXPECT_GT(found.modes[0].gain_std, 0.0);
  EXPECT_THROW(gainsAtPoles(responseOf(model), poles, 100.0, 110.0), Error);
}

// A slightly higher frequency, damping and gain follow from the change of the FRF.
TEST(PoleGains, AChangeOfTheFrfShiftsTheModes) {
  const ModalModel model = twoModes();
  ModalModel other = model;
  other.modes[0].frequency *= 1.0 + 1e-4;
  other.modes[0].damping_ratio *= 1.0 - 2e-3;
  other.modes[1].gain *= 1.0 + 5e-3;
  const FrequencyResponse frf = responseOf(model);
  std::vector<Complex> change = responseOf(other).value;
  for (std::size_t k = 0; k < change.size(); ++k) change[k] -= frf.value[k];
  const ModalModel shift = modeShifts(frf, change, model, 100.0, 3000.0);
  EXPECT_NEAR(shift.modes[0].frequency, 0.08, 0.001);
  EXPECT_NEAR(shift.modes[0].damping_ratio, -6e-5, 1e-6);
  EXPECT_NEAR(shift.modes[1].gain, -3e-11, 1e-12);
  EXPECT_NEAR(shift.modes[1].frequency, 0.0, 0.01);
}

// First order compared with the beam itself: the residual is proportional to the square of the step.
TEST(HeldTool, ModesOfASimilarToolAreOfFirstOrder) {
  ToolInHolder tool{5.8e11, 14300.0, 60e-3, 12e-3, 30e-3, 9.6e-3, 2e8, 2e5, {}};
  tool.spindle = {{900.0, 5e-9, 4.0}, {1700.0, 3e-9, -6.0}};
  const HeldTool held(tool);
  const auto off = [&](double step) {
    ToolInHolder near = tool;
    near.young *= 1.0 + step;
    near.stickout *= 1.0 - 0.3 * step;
    near.rotational_stiffness *= 1.0 - step;
    near.spindle[1].tilt += 3.0 * step;
    const HeldTool exact(near);
    const std::vector<HeldMode> first = held.modesOf(near);
    double largest = 0.0;
    for (std::size_t k = 0; k < 5; ++k) {
      largest = std::max(largest, std::abs(first[k].frequency / exact.modes()[k].frequency - 1.0));
      largest =
          std::max(largest, std::abs(first[k].gain(15e-3, 2e-3) - exact.modes()[k].gain(15e-3, 2e-3)) / 1e-8);
    }
    return largest;
  };
  EXPECT_LT(off(1e-3), 1e-4);
  EXPECT_NEAR(off(1e-3) / off(5e-4), 4.0, 0.4);
}

}  // namespace
}  // namespace smartmill::hammer
