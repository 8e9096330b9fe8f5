#include "smartmill_stability/solvers/cross_modes.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;

struct Structure {
  ModalModel x, y;  ///< fitted along x and y
  FrequencyResponse cross;
};

/// Two modes along principal directions rotated from x by an angle [rad]: receptances c^2 a + s^2 b, s^2 a +
/// c^2 b, c s (a - b).
Structure rotated(double angle, double noise = 0.0) {
  const Mode a{900.0, 0.03, 4e-8}, b{940.0, 0.02, 2e-8};
  const double c = std::cos(angle), s = std::sin(angle);
  Structure one;
  const auto scaled = [](Mode mode, double share) {
    mode.gain *= share;
    return mode;
  };
  one.x.modes = {scaled(a, c * c), scaled(b, s * s)};
  one.y.modes = {scaled(a, s * s), scaled(b, c * c)};
  one.cross.unit = "m/N";
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const ModalModel first{{a}, 0.0}, second{{b}, 0.0};
  for (double f = 300.0; f < 2000.0; f += 2.0) {
    one.cross.frequency.push_back(f);
    one.cross.value.push_back(c * s * (first.response(f) - second.response(f)) +
                              noise * Complex(normal(random), normal(random)));
  }
  return one;
}

double limitOf(const std::vector<SystemMode>& modes, double speed) {
  RegenerativeSystem system;
  system.modes = modes;
  system.teeth = 3;
  system.entry = 0.0;
  system.exit = units::TWO_PI;
  system.kt = 800e6;
  system.kr = 250e6;
  return makeSolver(Method::collocation, system)->limit(speed, 0.1).depth;
}

// With full engagement no direction is preferred: a rotated structure has the same limits with the cross
// receptance, but not without it.
TEST(CrossModes, aRotatedStructureHasTheSameLimits) {
  const Structure straight = rotated(0.0), other = rotated(units::PI / 5.0);
  double most_without = 0.0;
  for (const double rpm : {9000.0, 12500.0, 16000.0}) {
    const double speed = units::radPerSecFromRpm(rpm);
    ModalModel x{{straight.x.modes[0]}, 0.0}, y{{straight.y.modes[1]}, 0.0};
    const double expected = limitOf(systemModes(x, y), speed);
    EXPECT_NEAR(limitOf(crossModes(other.x, other.y, other.cross), speed) / expected, 1.0, 1e-3) << rpm;
    most_without =
        std::max(most_without, std::abs(limitOf(systemModes(other.x, other.y), speed) / expected - 1.0));
  }
  EXPECT_GT(most_without, 0.02);
}

// The receptances of the modes are the measured ones, and xy equals yx.
TEST(CrossModes, receptancesAreTheMeasuredOnes) {
  for (const double angle : {0.3, -0.7, 1.2}) {
    const Structure one = rotated(angle, 1e-9);
    const std::vector<SystemMode> modes = crossModes(one.x, one.y, one.cross);
    double peak = 0.0;
    for (const Complex& v : rotated(angle).cross.value) peak = std::max(peak, std::abs(v));
    for (const double f : {500.0, 880.0, 905.0, 940.0, 1500.0}) {
      const auto g = receptance(modes, f);
      EXPECT_LT(std::abs(g[0] - one.x.response(f)), 1e-2 * peak + 0.01 * std::abs(g[0]));
      EXPECT_LT(std::abs(g[3] - one.y.response(f)), 1e-2 * peak + 0.01 * std::abs(g[3]));
      EXPECT_EQ(g[1], g[2]);
      EXPECT_LT(std::abs(g[1] - rotated(angle).cross.at(f)), 0.02 * peak) << angle << " " << f;
    }
  }
}

TEST(CrossModes, noiseGivesNoCrossModes) {
  Structure one = rotated(0.3);
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0.0, 1e-7);
  for (Complex& v : one.cross.value) v = Complex(normal(random), normal(random));
  std::size_t axial = 0;
  for (const SystemMode& m : crossModes(one.x, one.y, one.cross))
    axial += m.input[0] == 0.0 || m.input[1] == 0.0;
  EXPECT_GE(axial, 2u);
  EXPECT_EQ(crossModes(one.x, one.y, {}).size(), systemModes(one.x, one.y).size());
}

}  // namespace
}  // namespace smartmill::stability
