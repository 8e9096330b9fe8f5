#include "smartmill_core/cutting/contact.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/contact_arc.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

// A slot: the half circle ahead of the tool, in the machine clockwise from +y. Half immersion: its left half.
TEST(ContactArc, turnsWithTheFeed) {
  constexpr double PI = units::PI;
  const auto arcs = [](double entry, double exit, double direction) {
    return contactArcs({entry, exit, 1e-3, 1e-4}, direction);
  };
  const auto expect = [](const std::vector<ContactArc>& found,
                         const std::vector<std::array<double, 2>>& ends) {
    ASSERT_EQ(found.size(), ends.size());
    for (std::size_t k = 0; k < ends.size(); ++k) {
      EXPECT_NEAR(found[k].entry, ends[k][0], 1e-12);
      EXPECT_NEAR(found[k].exit, ends[k][1], 1e-12);
      EXPECT_EQ(found[k].depth, 1e-3);
      validate(found[k]);
    }
  };
  expect(arcs(0.0, PI, 0.0), {{0.0, PI}});
  expect(arcs(0.0, PI, PI), {{PI, 2.0 * PI}});                               // along -x
  expect(arcs(0.0, PI, 0.5 * PI), {{1.5 * PI, 2.0 * PI}, {0.0, 0.5 * PI}});  // along +y
  expect(arcs(0.0, PI, -0.5 * PI), {{0.5 * PI, 1.5 * PI}});                  // along -y
  expect(arcs(0.0, 0.5 * PI, 0.5 * PI), {{1.5 * PI, 2.0 * PI}});
  const double entry = 1.2, exit = 3.1;
  EXPECT_EQ(arcs(entry, exit, 0.0)[0].entry, entry);
  EXPECT_EQ(arcs(entry, exit, 0.0)[0].exit, exit);
}

// Two bands over each other are the whole edge; the upper one lags.
TEST(ContactArc, bandsOfAnEdgeSumToTheWhole) {
  ToolGeometry tool;
  tool.teeth = 3;
  tool.diameter = 10e-3;
  tool.helix = 0.6;
  const CuttingCoefficients k{1e9, 4e8, 2e8, 2e4, 1.5e4, 1e3};
  const Engagement whole{0.3, 2.1, 4e-3, 1e-4};
  Engagement bands = whole;
  bands.bands = {{0.3, 2.1, 0.0, 1.5e-3}, {0.3, 2.1, 1.5e-3, 4e-3}};
  CuttingLaw law;
  law.coefficients = k;
  RigidCut one(tool, law, whole), two(tool, law, bands);
  const MechanisticForce first(tool, k, whole), second(tool, k, bands);
  for (double angle = 0.0; angle < 6.3; angle += 0.1) {
    EXPECT_NEAR(two.at(angle).fx, one.at(angle).fx, 1e-6);
    EXPECT_NEAR(two.at(angle).torque, one.at(angle).torque, 1e-8);
    EXPECT_NEAR(second.at(angle).fy, first.at(angle).fy, 1e-9);
  }
  EXPECT_NEAR(second.mean().fx, first.mean().fx, 1e-9);
  EXPECT_NEAR(two.meanTerms()[0].fy, one.meanTerms()[0].fy, 1e-9);
  // A band alone, by the difference of two cuts.
  Engagement upper = whole, low = whole;
  upper.bands = {{0.3, 2.1, 1.5e-3, 4e-3}};
  low.axial_depth = 1.5e-3;
  RigidCut band(tool, law, upper), below(tool, law, low);
  for (double angle = 0.0; angle < 6.3; angle += 0.1)
    EXPECT_NEAR(band.at(angle).fy, one.at(angle).fy - below.at(angle).fy, 1e-3);
}

TEST(SineCosine, equalsTheStandardLibrary) {
  for (double angle = 0.0; angle < 12.5; angle += 0.00713) {
    EXPECT_NEAR(sineCosine(angle).sine, std::sin(angle), 1e-12);
    EXPECT_NEAR(sineCosine(angle).cosine, std::cos(angle), 1e-12);
    const double d = 0.2 * std::sin(7.0 * angle);
    EXPECT_NEAR(turned(sineCosine(angle), d).sine, std::sin(angle + d), 1e-11);
    EXPECT_NEAR(turned(sineCosine(angle), d).cosine, std::cos(angle + d), 1e-11);
  }
}

ChipShape drawn(std::mt19937& random, double size) {
  std::normal_distribution<double> normal(0.0, size);
  return {normal(random), normal(random), normal(random), 0.1 * normal(random), 0.1 * normal(random)};
}

TEST(ChipShape, slopeAndBoundsAreCorrect) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 200; ++trial) {
    const ChipShape shape = drawn(random, 1.0);
    const AngleInterval over = AngleInterval::between(0.03 * trial, 0.03 * trial + 0.2);
    const ChipBounds b = bounds(shape, over);
    for (double phi = over.low(); phi <= over.high(); phi += 0.002) {
      const double s = std::sin(phi), c = std::cos(phi), value = shape.at(s, c);
      EXPECT_NEAR(value,
                  shape.level + shape.sine * s + shape.cosine * c + shape.sine2 * std::sin(2.0 * phi) +
                      shape.cosine2 * std::cos(2.0 * phi),
                  1e-12);
      const double d = 1e-6, after = shape.at(std::sin(phi + d), std::cos(phi + d));
      EXPECT_NEAR(shape.slope(s, c), (after - value) / d, 2e-5);
      EXPECT_GE(value, b.low - 1e-12);
      EXPECT_LE(value, b.high + 1e-12);
    }
  }
}

// Segments of the smallest of several random chips, compared with a fine grid: exactly the angles where the
// smallest chip is positive lie in a segment of that shape.
TEST(Contact, findsEverySegmentInWhichAChipIsSmallestAndPositive) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform;
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<ChipShape> shapes;
    const int count = 1 + trial % 9;
    for (int k = 0; k < count; ++k) shapes.push_back(drawn(random, 1.0));
    const double from = 6.0 * uniform(random), to = from + 6.0 * uniform(random) * uniform(random);
    std::vector<ChipShape> used = shapes;
    double covered = 0.0, end = from;
    forEachContact(
        used.data(), used.size(), from, to, [&](const ChipShape& shape, const AngleInterval& over) {
          EXPECT_GE(over.low(), end - 1e-12);
          end = over.high();
          covered += 2.0 * over.half;
          for (const double at : {0.01, 0.3, 0.7, 0.99}) {
            const double phi = over.low() + at * 2.0 * over.half, s = std::sin(phi), c = std::cos(phi);
            EXPECT_GE(shape.at(s, c), -1e-6);
            for (const ChipShape& other : shapes) EXPECT_LE(shape.at(s, c), other.at(s, c) + 2e-5);
          }
        });
    double expected = 0.0;
    const int steps = 20000;
    for (int i = 0; i < steps; ++i) {
      const double phi = from + (to - from) * (i + 0.5) / steps, s = std::sin(phi), c = std::cos(phi);
      double least = 1e300;
      for (const ChipShape& shape : shapes) least = std::min(least, shape.at(s, c));
      expected += least > 0.0 ? (to - from) / steps : 0.0;
    }
    EXPECT_NEAR(covered, expected, 4.0 * (to - from) / steps + 2e-4) << trial;
  }
}

// The start of a contact within a cell is exact, since edge forces set in at once.
TEST(Contact, beginsWhereTheChipBegins) {
  ChipShape shape;
  shape.sine = 60e-6;
  shape.level = -20e-6;
  double begin = -1.0, end = 0.0;
  forEachContact(&shape, 1, 0.0, units::PI, [&](const ChipShape&, const AngleInterval& over) {
    if (begin < 0.0) begin = over.low();
    end = over.high();
  });
  EXPECT_NEAR(begin, std::asin(1.0 / 3.0), 1e-9);
  EXPECT_NEAR(end, units::PI - std::asin(1.0 / 3.0), 1e-9);
}

// The formula of formats.md, feed along x.
TEST(ChipRule, equalsTheFormula) {
  ToolGeometry tool{3, 12e-3, 0.5, {}};
  tool.pitch = {2.0, 2.2, units::TWO_PI - 4.2};
  const std::vector<double> r{3e-6, -5e-6, 1e-6};
  const ChipRule rule(tool, r);
  const double feed = 3e-5;  // [m/rad]
  for (int j = 0; j < 3; ++j) {
    double turned = 0.0;
    for (int n = 1; n <= 7; ++n) {
      turned += tool.pitch[static_cast<std::size_t>((j + n - 1) % 3)];
      EXPECT_NEAR(rule.turn(j, n), turned, 1e-12);
      const double fn = feed * turned, f1 = feed * tool.pitch[static_cast<std::size_t>(j)];
      const double step = r[static_cast<std::size_t>(j)] - r[static_cast<std::size_t>((j + n) % 3)];
      for (double phi = 0.0; phi < 6.28; phi += 0.1) {
        const double s = std::sin(phi), c = std::cos(phi);
        const double h = fn * s + (fn * fn - f1 * f1) * c * c / tool.diameter + step;
        EXPECT_NEAR(rule.steadyShape(j, n, {{feed, 0.0}}).at(s, c), h, 1e-16);
        EXPECT_NEAR(rule.shape(j, n, {{fn, 0.0}}, {{f1, 0.0}}, {{2e-6, -7e-6}}).at(s, c),
                    h + 2e-6 * s - 7e-6 * c, 1e-16);
      }
    }
  }
  EXPECT_FALSE(rule.alike());
  EXPECT_NEAR(rule.overhang(0), 8e-6, 1e-18);  // tooth 2, the smallest, is met first
}

}  // namespace
}  // namespace smartmill
