#include "smartmill_core/cutting/mechanistic.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

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

/// The force of a general end mill (Engin & Altintas 2001) summed over elements of its edges: lag,
/// inclination and local radius at each height from the definition of the shape.
CuttingForce generalMill(const ToolGeometry& t, const CuttingCoefficients& k, const Engagement& e,
                         double angle) {
  const double r = t.edge.corner_radius, lean = t.edge.edge_angle, top = r * (1.0 - std::cos(lean));
  constexpr int ELEMENTS = 4000;
  CuttingForce sum;
  double position = 0.0;
  for (int tooth = 0; tooth < t.teeth; ++tooth) {
    const auto helix = t.edge.helix.empty() ? t.helix : t.edge.helix[static_cast<std::size_t>(tooth)];
    const double pitch_at_tip = t.pitch.empty() ? TWO_PI / t.teeth : t.pitch[static_cast<std::size_t>(tooth)];
    const auto next =
        t.edge.helix.empty() ? t.helix : t.edge.helix[static_cast<std::size_t>((tooth + 1) % t.teeth)];
    for (int i = 0; i < ELEMENTS; ++i) {
      // Finer towards the tip, where the edge per height grows.
      const double s = (i + 0.5) / ELEMENTS, z = e.axial_depth * s * s;
      const double dz = 2.0 * e.axial_depth * s / ELEMENTS;
      const double kappa = z < top ? std::acos(1.0 - z / r) : lean;
      const double radius = z < top ? t.radius() - r * std::tan(0.5 * lean) + r * std::sin(kappa)
                                    : t.radius() + z / std::tan(lean);
      const double phi =
          std::fmod(angle + position - z * std::tan(helix) / t.radius() + 8.0 * TWO_PI, TWO_PI);
      const double pitch = pitch_at_tip - z * (std::tan(next) - std::tan(helix)) / t.radius();
      const double h = e.feed_per_tooth * t.teeth * pitch / TWO_PI * std::sin(phi) * std::sin(kappa);
      if (phi < e.entry || phi >= e.exit || h <= 0.0) continue;
      const double length = dz / std::sin(kappa);
      const double ft = (k.ktc * h + k.kte) * length, fr = (k.krc * h + k.kre) * length,
                   fa = (k.kac * h + k.kae) * length;
      const double across = fr * std::sin(kappa) - fa * std::cos(kappa);
      sum.fx += -ft * std::cos(phi) - across * std::sin(phi);
      sum.fy += ft * std::sin(phi) - across * std::cos(phi);
      sum.fz += fr * std::cos(kappa) + fa * std::sin(kappa);
      sum.torque += ft * radius;
    }
    position += pitch_at_tip;
  }
  return sum;
}

struct ShapedCase {
  const char* name;
  double corner_mm, edge_deg;
  std::vector<double> helix_deg;
};

TEST(MechanisticForce, edgesOfOtherShapesAreTheSumOfTheirElements) {
  const Engagement cut{0.3, 2.4, 4e-3, 1e-4};
  for (const ShapedCase& shape :
       {ShapedCase{"bull nose", 2.0, 90.0, {}}, ShapedCase{"ball", 10.0, 90.0, {}},
        ShapedCase{"face mill", 0.0, 45.0, {}}, ShapedCase{"rounded face mill", 1.5, 60.0, {}},
        ShapedCase{"variable helix", 0.0, 90.0, {30.0, 38.0, 34.0}},
        ShapedCase{"bull nose of variable helix", 2.0, 90.0, {30.0, 38.0, 34.0}}}) {
    ToolGeometry t = tool(3, 0.02, 30.0);
    t.edge.corner_radius = 1e-3 * shape.corner_mm;
    if (shape.edge_deg < 90.0) t.edge.edge_angle = radFromDeg(shape.edge_deg);
    std::vector<double> helix;
    for (const double h : shape.helix_deg) helix.push_back(radFromDeg(h));
    if (!helix.empty()) t.setHelix(helix);
    const MechanisticForce force(t, ALUMINIUM, cut);
    double most = 0.0, error = 0.0;
    CuttingForce mean;
    constexpr int ANGLES = 360;
    for (int i = 0; i < ANGLES; ++i) {
      const CuttingForce a = force.at(TWO_PI * (i + 0.5) / ANGLES);
      mean.add(a, 1.0 / ANGLES);
      if (i % 5 != 0) continue;
      const CuttingForce b = generalMill(t, ALUMINIUM, cut, TWO_PI * (i + 0.5) / ANGLES);
      most = std::max({most, std::abs(b.fx), std::abs(b.fy)});
      error = std::max({error, std::abs(a.fx - b.fx), std::abs(a.fy - b.fy), std::abs(a.fz - b.fz),
                        std::abs(a.torque - b.torque) / t.radius()});
    }
    // Slices with a uniform lag and a uniform pitch.
    EXPECT_LT(error, 1e-2 * most) << shape.name;
    const CuttingForce closed = force.mean();
    EXPECT_NEAR(closed.fx, mean.fx, 2e-3 * most) << shape.name;
    EXPECT_NEAR(closed.fy, mean.fy, 2e-3 * most) << shape.name;
    EXPECT_NEAR(closed.fz, mean.fz, 2e-3 * most) << shape.name;
    EXPECT_NEAR(closed.torque, mean.torque, 2e-3 * most * t.radius()) << shape.name;
  }
}

// Two parts of the height have the force of both together.
TEST(MechanisticForce, aCutAboveTheTipIsTheRestOfTheWholeCut) {
  const CuttingCoefficients k{700e6, 300e6, 120e6, 25e3, 20e3, 8e3};
  std::vector<ToolGeometry> tools(4, ToolGeometry{3, 12e-3, 0.6, {}});
  tools[1].edge.corner_radius = 2e-3;
  tools[2].edge.corner_radius = 6e-3;
  tools[3].edge.edge_angle = 0.8;
  for (const ToolGeometry& tool : tools) {
    for (const double bottom : {0.3e-3, 1.1e-3, 2.7e-3}) {
      const Engagement whole{0.4, 2.2, 3e-3, 0.08e-3}, below{0.4, 2.2, bottom, 0.08e-3};
      for (double angle = 0.0; angle < 6.2; angle += 0.31) {
        CuttingForce sum = MechanisticForce(tool, k, below).at(angle);
        sum.add(MechanisticForce(tool, k, whole, bottom).at(angle));
        const CuttingForce expected = MechanisticForce(tool, k, whole).at(angle);
        // A slice of a cone has the radius of its middle.
        const double tolerance = tool.edge.edge_angle < 1.5 ? 0.02 : 2e-3;
        EXPECT_NEAR(sum.fx, expected.fx, 0.5 * tolerance * 500);
        EXPECT_NEAR(sum.fy, expected.fy, 0.5 * tolerance * 500);
        EXPECT_NEAR(sum.torque, expected.torque, tolerance * 3);
      }
      CuttingForce mean = MechanisticForce(tool, k, below).mean();
      mean.add(MechanisticForce(tool, k, whole, bottom).mean());
      EXPECT_NEAR(mean.fy, MechanisticForce(tool, k, whole).mean().fy, 1e-9 + 1e-9 * std::abs(mean.fy));
    }
  }
  EXPECT_THROW(MechanisticForce(tools[0], k, {0.4, 2.2, 3e-3, 0.08e-3}, 3e-3), Error);
}

// Ball end, one edge engaged over its radius r: integrals over a quarter of a circle.
TEST(MechanisticForce, meanForceOfABallEndHasAClosedForm) {
  const double r = 10e-3, c = 1e-4;
  ToolGeometry ball = tool(2, 2.0 * r, 30.0);
  ball.edge.corner_radius = r;
  const auto m = meanForceMatrix(ball, {0.0, PI, r, c});
  const double teeth = 2.0 / TWO_PI;
  EXPECT_NEAR(m[1][0], teeth * 0.5 * PI * c * r, 1e-12);              // fy of Ktc: sin^2
  EXPECT_NEAR(m[0][1], -teeth * 0.5 * PI * c * r * PI / 4.0, 1e-12);  // fx of Krc: mean of sin(kappa)
  EXPECT_NEAR(m[0][2], teeth * 0.5 * PI * c * r / 2.0, 1e-12);        // fx of Kac: mean of cos(kappa)
  EXPECT_NEAR(m[2][1], teeth * 2.0 * c * r / 2.0, 1e-12);             // fz of Krc
  EXPECT_NEAR(m[1][3], teeth * 2.0 * r * PI / 2.0, 1e-9);             // fy of Kte: length of the edge
  EXPECT_NEAR(m[3][3], teeth * PI * r * r, 1e-12);                    // torque of Kte: radius over the edge
  const double chip = teeth * 2.0 * c * r * r * PI / 4.0;             // torque of Ktc: radius over the height
  EXPECT_NEAR(m[3][0], chip, 2e-3 * chip);
  // A finishing cut near the tip, between heights that are not those of slices.
  const double depth = 0.07 * r, lean = std::acos(1.0 - depth / r);
  Engagement bands{0.0, PI, depth, c};
  for (int k = 0; k < 7; ++k) bands.bands.push_back({0.0, PI, k * depth / 7, (k + 1) * depth / 7});
  const double edge = teeth * PI * r * r * (1.0 - std::cos(lean));
  EXPECT_NEAR(meanForceMatrix(ball, bands)[3][3], edge, 1e-12);
  EXPECT_NEAR(meanForceMatrix(ball, {0.0, PI, depth, c})[3][3], edge, 1e-12);
}

// The chip of a ball that also feeds along its axis: c sin(phi) sin(kappa) + a cos(kappa). In a slot over the
// whole radius and down, T = N / (2 pi) Ktc (2 c pi r^2 / 4 + pi a r^2 / 2); up, the part without a chip does
// not cut.
TEST(MechanisticForce, anAxialFeedOfABallHasAClosedForm) {
  const double r = 10e-3, c = 1e-4;
  ToolGeometry ball = tool(2, 2.0 * r, 30.0);
  ball.edge.corner_radius = r;
  for (const double slope : {0.2, 0.02, -0.02, -0.2}) {
    const double a = slope * c;
    Engagement cut{0.0, PI, r, c};
    cut.axial_feed_per_tooth = a;
    double chip = 0.0;
    constexpr int PARTS = 400;
    for (int i = 0; i < PARTS; ++i) {
      const double kappa = 0.5 * PI * (i + 0.5) / PARTS, sine = std::sin(kappa), cosine = std::cos(kappa);
      for (int j = 0; j < PARTS; ++j) {
        const double phi = PI * (j + 0.5) / PARTS;
        chip += std::max(0.0, c * std::sin(phi) * sine + a * cosine) * r * sine * r * 0.5 * PI / PARTS * PI /
                PARTS;
      }
    }
    if (slope > 0.0) {
      EXPECT_NEAR(chip, 2.0 * c * PI * r * r / 4.0 + PI * a * r * r / 2.0, 1e-4 * chip);
    }
    const double expected = 2.0 / TWO_PI * chip;
    EXPECT_NEAR(meanForceMatrix(ball, cut)[3][0], expected, 3e-3 * expected) << slope;
    // The mean of the force over the angle is that of the matrix.
    const CuttingCoefficients k{1e9, 4e8, 2e8, 0.0, 0.0, 0.0};
    const MechanisticForce force(ball, k, cut);
    CuttingForce mean;
    for (int i = 0; i < 720; ++i) mean.add(force.at(TWO_PI * (i + 0.5) / 720), 1.0 / 720);
    EXPECT_NEAR(mean.torque, force.mean().torque, 1e-4 * force.mean().torque);
    EXPECT_NEAR(mean.fy, force.mean().fy, 1e-4 * std::abs(force.mean().fy));
  }
  // A flat end mill has no inclined edge.
  Engagement cut{0.3, 2.0, 2e-3, c};
  const auto level = meanForceMatrix(tool(2, 2.0 * r, 30.0), cut);
  cut.axial_feed_per_tooth = 0.5 * c;
  EXPECT_EQ(meanForceMatrix(tool(2, 2.0 * r, 30.0), cut), level);
}

TEST(MechanisticForce, refusesASerratedEdge) {
  ToolGeometry rough = tool(3, 0.02, 30.0);
  rough.edge.serration_amplitude = 1e-4;
  rough.edge.serration_wavelength = 1e-3;
  const Engagement slot{0.0, PI, 0.002, 1e-4};
  EXPECT_NE(messageOf(rough, slot).find("serration: amplitude_mm: 0.1, expected a smooth edge"),
            std::string::npos);
  EXPECT_THROW(meanForceMatrix(rough, slot), Error);
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
