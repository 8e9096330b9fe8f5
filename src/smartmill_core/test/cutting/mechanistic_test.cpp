#include "smartmill_core/cutting/mechanistic.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using units::PI;
using units::radFromDeg;
using units::TWO_PI;

const CuttingCoefficients ALUMINIUM{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};

ToolGeometry tool(int teeth, double diameter, double helix_deg) {
  return {teeth, diameter, radFromDeg(helix_deg), {}};
}

// The definition of formats.md, summed over thin discs, independent of the closed form.
CuttingForce quadrature(const ToolGeometry& t, const CuttingCoefficients& k, const Engagement& e,
                        double angle, int discs) {
  CuttingForce sum;
  double position = 0.0;
  for (int tooth = 0; tooth < t.teeth; ++tooth) {
    const double pitch = t.pitch.empty() ? TWO_PI / t.teeth : t.pitch[static_cast<std::size_t>(tooth)];
    for (int i = 0; i < discs; ++i) {
      const double dz = e.axial_depth / discs, z = (i + 0.5) * dz;
      double phi = std::fmod(angle + position - z * std::tan(t.helix) / (0.5 * t.diameter), TWO_PI);
      if (phi < 0.0) phi += TWO_PI;
      const double h = e.feed_per_tooth * t.teeth * pitch / TWO_PI * std::sin(phi);
      if (phi < e.entry || phi >= e.exit || h <= 0.0) continue;
      const double ft = (k.ktc * h + k.kte) * dz, fr = (k.krc * h + k.kre) * dz,
                   fa = (k.kac * h + k.kae) * dz;
      sum.fx += -ft * std::cos(phi) - fr * std::sin(phi);
      sum.fy += ft * std::sin(phi) - fr * std::cos(phi);
      sum.fz += fa;
      sum.torque += ft * 0.5 * t.diameter;
    }
    position += pitch;
  }
  return sum;
}

void expectNear(const CuttingForce& a, const CuttingForce& b, double force, double radius) {
  EXPECT_NEAR(a.fx, b.fx, force);
  EXPECT_NEAR(a.fy, b.fy, force);
  EXPECT_NEAR(a.fz, b.fz, force);
  EXPECT_NEAR(a.torque, b.torque, force * radius);
}

TEST(MechanisticForce, equalsQuadratureAlongTheHelixForAnyToolAndEngagement) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(0.0, 1.0);
  for (int trial = 0; trial < 40; ++trial) {
    ToolGeometry t = tool(1 + trial % 6, 0.006 + 0.02 * u(random), trial % 5 == 0 ? 0.0 : 75.0 * u(random));
    if (trial % 3 == 0) {
      double sum = 0.0;
      for (int i = 0; i < t.teeth; ++i) sum += t.pitch.emplace_back(1.0 + 0.3 * u(random));
      for (double& p : t.pitch) p *= TWO_PI / sum;
    }
    Engagement e;
    e.entry = 0.9 * PI * u(random);
    e.exit = e.entry + 0.01 + (TWO_PI - e.entry - 0.01) * u(random);
    e.axial_depth = 0.03 * u(random) + 1e-4;
    e.feed_per_tooth = 2e-4 * u(random) + 1e-6;
    const MechanisticForce model(t, ALUMINIUM, e);
    const double angle = 40.0 * (u(random) - 0.5);
    const int discs = 20000;
    // A disc at a limit of the engagement is in or out as a whole: an error of two discs per tooth and helix
    // revolution, of the largest force of a disc.
    const double chip = e.feed_per_tooth * t.teeth;
    const double disc = (ALUMINIUM.ktc * chip + ALUMINIUM.kte) * e.axial_depth / discs;
    const double turns = 2.0 + t.lag() * e.axial_depth / TWO_PI;
    expectNear(model.at(angle), quadrature(t, ALUMINIUM, e, angle, discs), 3.0 * t.teeth * turns * disc,
               t.radius());
  }
}

TEST(MechanisticForce, meanOverARevolutionEqualsTheClosedFormAndIgnoresTheHelix) {
  for (const double helix : {0.0, 1e-7, 30.0, 60.0}) {
    ToolGeometry t = tool(3, 0.012, helix);
    t.pitch = {radFromDeg(110.0), radFromDeg(130.0), radFromDeg(120.0)};
    const Engagement e{radFromDeg(20.0), radFromDeg(140.0), 0.004, 8e-5};
    const MechanisticForce model(t, ALUMINIUM, e);
    CuttingForce sum;
    const int n = 36000;
    for (int i = 0; i < n; ++i) {
      const CuttingForce f = model.at(TWO_PI * (i + 0.5) / n);
      sum.fx += f.fx / n, sum.fy += f.fy / n, sum.fz += f.fz / n, sum.torque += f.torque / n;
    }
    // The midpoint rule has an error of half a step at each jump of straight teeth: 1/n of a force of about
    // 500 N.
    expectNear(model.mean(), sum, 0.05, t.radius());
  }
}

TEST(MechanisticForce, slotMeansEqualThePublishedFormulas) {
  const ToolGeometry t = tool(4, 0.01905, 30.0);
  const Engagement e{0.0, PI, 0.002, 6e-5};
  const CuttingForce mean = MechanisticForce(t, ALUMINIUM, e).mean();
  const double n = 4, a = e.axial_depth, c = e.feed_per_tooth;
  const CuttingCoefficients& k = ALUMINIUM;
  // Altintas, Manufacturing Automation: mean milling forces of a slot.
  EXPECT_NEAR(mean.fx, -n * a / 4.0 * k.krc * c - n * a / PI * k.kre, 1e-9);
  EXPECT_NEAR(mean.fy, n * a / 4.0 * k.ktc * c + n * a / PI * k.kte, 1e-9);
  EXPECT_NEAR(mean.fz, n * a / PI * k.kac * c + n * a / 2.0 * k.kae, 1e-9);
  // Dunwoody eq. 3.19.
  EXPECT_NEAR(mean.torque, t.radius() * n * a * k.ktc / PI * c + t.radius() * n * a * k.kte / 2.0, 1e-12);
}

TEST(MechanisticForce, oneStraightToothGivesTheElementaryForce) {
  const ToolGeometry t = tool(1, 0.02, 0.0);
  const Engagement e{0.0, PI, 0.001, 1e-4};
  const MechanisticForce model(t, ALUMINIUM, e);
  const double phi = 0.7, h = 1e-4 * std::sin(phi), a = e.axial_depth;
  const CuttingForce expected =
      toolForce((ALUMINIUM.ktc * h + ALUMINIUM.kte) * a, (ALUMINIUM.krc * h + ALUMINIUM.kre) * a,
                (ALUMINIUM.kac * h + ALUMINIUM.kae) * a, phi, t.radius());
  expectNear(model.at(phi), expected, 1e-9, t.radius());
  expectNear(model.at(phi + PI), CuttingForce{}, 0.0, 1.0);
  expectNear(model.at(phi - 6.0 * PI), expected, 1e-9, t.radius());
}

TEST(MechanisticForce, smallHelixConvergesToZeroHelix) {
  const Engagement e{0.3, 2.0, 0.003, 5e-5};
  const CuttingForce straight = MechanisticForce(tool(2, 0.02, 0.0), ALUMINIUM, e).at(1.0);
  for (const double helix : {1e-3, 1e-7, 1e-12, 1e-300}) {
    // The force changes by its slope (about its own size per radian) times half the lag.
    expectNear(MechanisticForce(tool(2, 0.02, helix), ALUMINIUM, e).at(1.0), straight, 1e-6 + helix, 0.01);
  }
}

TEST(MechanisticForce, smallImmersionKeepsItsPrecision) {
  const ToolGeometry t = tool(2, 0.02, 30.0);
  const double arc = 1e-7;
  const Engagement e{PI - arc, PI, 0.002, 1e-4};
  const CuttingForce mean = MechanisticForce(t, ALUMINIUM, e).mean();
  const double edge = 2 * 0.002 * arc / TWO_PI, chip = 1e-4 * arc / 2.0;
  // To first order in the arc; Fx: cos = -1. The angles themselves are rounded: 1e-16 of an arc
  // of 1e-7.
  EXPECT_NEAR(mean.fx, edge * (ALUMINIUM.ktc * chip + ALUMINIUM.kte - ALUMINIUM.kre * arc / 2.0),
              1e-8 * edge * ALUMINIUM.kte);
  EXPECT_NEAR(mean.torque, t.radius() * edge * (ALUMINIUM.ktc * chip + ALUMINIUM.kte),
              1e-8 * edge * ALUMINIUM.kte);
}

TEST(MechanisticForce, torqueTimesSpeedEqualsThePowerOfTheTangentialForces) {
  // Energy: work of the tangential force along the tooth's path in one revolution = mean torque x 2 pi, and
  // the work per volume removed is Ktc when the edge terms are zero (specific cutting energy).
  CuttingCoefficients k = ALUMINIUM;
  k.kte = k.kre = k.kae = 0.0;
  const ToolGeometry t = tool(3, 0.016, 40.0);
  const Engagement e{0.0, PI, 0.003, 7e-5};
  const double omega = 500.0;
  const double power = MechanisticForce(t, k, e).mean().torque * omega;
  const double feed_speed = e.feed_per_tooth * t.teeth * omega / TWO_PI;
  const double removal_rate = feed_speed * t.diameter * e.axial_depth;  // full slot
  EXPECT_NEAR(power, k.ktc * removal_rate, 1e-9 * power);
}

TEST(MechanisticForce, hasNoForceWithoutAPositiveChip) {
  const MechanisticForce behind(tool(2, 0.02, 30.0), ALUMINIUM, {1.2 * PI, 1.9 * PI, 0.002, 1e-4});
  expectNear(behind.mean(), CuttingForce{}, 0.0, 1.0);
  const MechanisticForce no_feed(tool(2, 0.02, 30.0), ALUMINIUM, {0.0, PI, 0.002, 0.0});
  expectNear(no_feed.at(1.0), CuttingForce{}, 0.0, 1.0);
}

std::string messageOf(const ToolGeometry& t, const Engagement& e, const CuttingCoefficients& k = ALUMINIUM) {
  try {
    MechanisticForce(t, k, e);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(MechanisticForce, errorsNameTheInvalidQuantity) {
  const Engagement slot{0.0, PI, 0.002, 1e-4};
  EXPECT_NE(messageOf(tool(0, 0.02, 30.0), slot).find("teeth: 0"), std::string::npos);
  EXPECT_NE(messageOf(tool(2, -0.02, 30.0), slot).find("diameter: -0.02"), std::string::npos);
  EXPECT_NE(messageOf(tool(2, 0.02, 80.0), slot).find("helix"), std::string::npos);
  EXPECT_NE(messageOf(tool(2, 0.02, 30.0), {1.0, 0.5, 0.002, 1e-4}).find("exit angle"), std::string::npos);
  EXPECT_NE(messageOf(tool(2, 0.02, 30.0), {0.0, PI, 0.0, 1e-4}).find("axial depth"), std::string::npos);
  CuttingCoefficients k = ALUMINIUM;
  k.kre = NAN;
  EXPECT_NE(messageOf(tool(2, 0.02, 30.0), slot, k).find("Kre"), std::string::npos);
}

// Turning is the limit of milling with one edge always in the cut about an immersion of pi/2: 20 teeth over
// an arc of one pitch, whose mean square of the sine differs from 1 by pitch^2 / 12 = 0.8 %.
TEST(MechanisticForce, turningIsAnEdgeThatStaysAcrossTheFeed) {
  const double pitch = units::TWO_PI / 20.0;
  const auto milling = meanForceMatrix({20, 0.06, 0.0, {}},
                                       {0.5 * (units::PI - pitch), 0.5 * (units::PI + pitch), 1e-3, 2e-4});
  const auto turning = meanForceMatrix({0, 0.06, 0.0, {}}, {0.0, 0.0, 1e-3, 2e-4});
  for (std::size_t r = 0; r < 4; ++r) {
    for (std::size_t c = 0; c < 6; ++c) {
      const double unit = (c < 3 ? 2e-7 : 1e-3) * (r == 3 ? 0.03 : 1.0);
      EXPECT_NEAR(turning[r][c], milling[r][c], 0.01 * unit) << r << ", " << c;
    }
  }
  EXPECT_NEAR(turning[3][0], 0.03 * 2e-7, 1e-15);
  EXPECT_THROW(meanForceMatrix({0, 0.0, 0.0, {}}, {0.0, 0.0, 1e-3, 2e-4}), Error);
  EXPECT_THROW(meanForceMatrix({0, 0.06, 0.0, {}}, {0.0, 0.0, 0.0, 2e-4}), Error);
}

}  // namespace
}  // namespace smartmill
