#include "smartmill_core/cutting/rigid_cut.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/disc_mill.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using units::PI;
using units::radFromDeg;
using units::TWO_PI;

CuttingLaw aluminium() {
  CuttingLaw law;
  law.coefficients = {796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};
  return law;
}

ToolGeometry mill(int teeth, double helix_deg, std::vector<double> pitch_deg = {}) {
  ToolGeometry tool{teeth, 19.05e-3, radFromDeg(helix_deg), {}};
  for (const double p : pitch_deg) tool.pitch.push_back(radFromDeg(p));
  return tool;
}

struct Setting {
  ToolGeometry tool;
  Engagement cut;
};

std::vector<Setting> settings() {
  return {{mill(4, 30.0), {0.0, PI, 2e-3, 6e-5}},
          {mill(4, 30.0), {0.0, 0.5 * PI, 4e-3, 8e-5}},
          {mill(4, 30.0), {0.5 * PI, PI, 4e-3, 8e-5}},
          {mill(1, 45.0), {1.2, 1.3, 10e-3, 5e-5}},
          {mill(2, 0.0), {0.4, 2.2, 3e-3, 1e-4}},
          {mill(4, 45.0), {0.0, PI, 70e-3, 5e-5}},  // the edge lags by more than a revolution
          {mill(4, 30.0, {85.0, 95.0, 88.0, 92.0}), {0.0, PI, 2e-3, 6e-5}}};
}

double largestDifference(const CuttingForce& a, const CuttingForce& b, double radius) {
  return std::max({std::abs(a.fx - b.fx), std::abs(a.fy - b.fy), std::abs(a.fz - b.fz),
                   std::abs(a.torque - b.torque) / radius});
}

double size(const CuttingForce& f) {
  return std::max(std::abs(f.fx), std::abs(f.fy));
}

testing::DiscMill discs(const Setting& s, const CuttingLaw& law, const std::vector<double>& radius) {
  const double feed = s.cut.feed_per_tooth * s.tool.teeth / TWO_PI;
  return {s.tool, law, radius, [feed](double turned) {
            return testing::DiscMill::State{turned, {{feed * turned, 0.0}}, {{0.0, 0.0}}};
          }};
}

// Without runout the chip is c sin(phi), with a closed-form integral (eq. 3.13..3.15).
TEST(RigidCut, equalsTheClosedFormWithoutRunout) {
  for (const Setting& s : settings()) {
    const MechanisticForce closed(s.tool, aluminium().coefficients, s.cut);
    RigidCut rigid(s.tool, aluminium(), s.cut);
    double largest = 0.0, difference = 0.0;
    for (int i = 0; i < 1777; ++i) {
      const double angle = -3.0 + TWO_PI * i / 1777.0;
      largest = std::max(largest, size(closed.at(angle)));
      difference =
          std::max(difference, largestDifference(rigid.at(angle), closed.at(angle), s.tool.radius()));
    }
    EXPECT_LT(difference, 2e-5 * largest) << s.tool.teeth << " teeth, depth " << s.cut.axial_depth;
    const auto [chip, edge] = rigid.meanTerms();
    const CuttingForce sum{chip.fx + edge.fx, chip.fy + edge.fy, chip.fz + edge.fz,
                           chip.torque + edge.torque};
    EXPECT_LT(largestDifference(sum, closed.mean(), s.tool.radius()),
              4e-6 * size(closed.mean()));  // two-point Gauss over 0.2 rad
  }
}

// The tables and the direct integral give the same force.
TEST(RigidCut, chipAndEdgeForcesSumToTheForce) {
  for (const Setting& s : settings()) {
    std::vector<double> radius;
    for (int j = 0; j < s.tool.teeth; ++j) radius.push_back(9e-6 * std::sin(2.0 + 3.0 * j));
    CuttingLaw law = aluminium();
    law.chip_factor = 1.3;
    law.edge_factor = 0.7;
    RigidCut rigid(s.tool, law, s.cut, radius);
    double largest = 0.0, difference = 0.0;
    for (int i = 0; i < 700; ++i) {
      const double angle = 0.009 * i;
      const auto [chip, edge] = rigid.termsAt(angle);
      const CuttingForce sum{1.3 * chip.fx + 0.7 * edge.fx, 1.3 * chip.fy + 0.7 * edge.fy,
                             1.3 * chip.fz + 0.7 * edge.fz, 1.3 * chip.torque + 0.7 * edge.torque};
      largest = std::max(largest, size(sum));
      difference = std::max(difference, largestDifference(rigid.at(angle), sum, s.tool.radius()));
    }
    // Error of a quarter of the edge force over a table cell in which a contact begins; a straight edge has
    // no tables.
    const double cell = s.tool.helix > 0.0 ? REVOLUTION_NODE_ANGLE / s.tool.lag() : 1e-9;
    EXPECT_LT(difference, 0.25 * 30.8e3 * cell + 2e-5 * largest) << s.tool.teeth << ", " << s.cut.axial_depth;
  }
}

// Any radii, any pitch, every term of the law: the rule of formats.md summed over discs.
TEST(RigidCut, equalsTheRuleSummedOverDiscs) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-20e-6, 20e-6);
  for (Setting s : settings()) {
    s.cut.axial_depth = std::min(s.cut.axial_depth, 10e-3);
    CuttingLaw law = aluminium();
    law.chip_factor = 1.2;
    law.edge_factor = 0.8;
    law.edge_chip = 5e-6;
    law.size_exponent = 0.2;
    std::vector<double> radius;
    for (int j = 0; j < s.tool.teeth; ++j) radius.push_back(u(random));
    testing::DiscMill reference = discs(s, law, radius);
    reference.passes = 10;
    const int thin = 4000;
    RigidCut rigid(s.tool, law, s.cut, radius);
    double largest = 0.0, difference = 0.0;
    for (int i = 0; i < 60; ++i) {
      const double angle = 0.05 + TWO_PI * i / 60.0;
      const CuttingForce expected = reference.force(angle, s.cut.entry, s.cut.exit, s.cut.axial_depth, thin);
      largest = std::max(largest, size(expected));
      difference = std::max(difference, largestDifference(rigid.at(angle), expected, s.tool.radius()));
    }
    // At the ends of the contacts whole discs are in or out, several of them at the same time.
    const double chip = s.cut.feed_per_tooth * s.tool.teeth + 40e-6;
    const double disc =
        (1.2 * 796e6 * std::pow(chip / 1e-4, -0.2) * chip + 27.7e3) * s.cut.axial_depth / thin;
    EXPECT_LT(difference, 3.0 * disc) << s.tool.teeth << " teeth, depth " << s.cut.axial_depth;
    EXPECT_LT(3.0 * disc, 0.02 * largest);
  }
}

// The force does not depend on which tooth is numbered first.
TEST(RigidCut, isInvariantUnderRenumberingOfTheTeeth) {
  const std::vector<double> pitch{85.0, 97.0, 88.0, 90.0}, radius{3e-6, -8e-6, 12e-6, 1e-6};
  const Engagement cut{0.2, 2.9, 3e-3, 5e-5};
  RigidCut rigid(mill(4, 35.0, pitch), aluminium(), cut, radius);
  double turned = 0.0;
  for (std::size_t first = 1; first < 4; ++first) {
    turned += radFromDeg(pitch[first - 1]);
    std::vector<double> other_pitch = pitch, other_radius = radius;
    std::rotate(other_pitch.begin(), other_pitch.begin() + static_cast<std::ptrdiff_t>(first),
                other_pitch.end());
    std::rotate(other_radius.begin(), other_radius.begin() + static_cast<std::ptrdiff_t>(first),
                other_radius.end());
    RigidCut other(mill(4, 35.0, other_pitch), aluminium(), cut, other_radius);
    for (int i = 0; i < 100; ++i) {
      const double angle = 0.0631 * i;
      EXPECT_LT(largestDifference(other.at(angle + turned), rigid.at(angle), 9.525e-3), 1e-9 * 400.0)
          << first;
    }
  }
}

// The force is invariant under a rotation of feed and stock.
TEST(RigidCut, isInvariantUnderRotationOfTheFeed) {
  const ToolGeometry tool = mill(4, 30.0, {85.0, 95.0, 88.0, 92.0});
  const std::vector<double> radius{3e-6, -8e-6, 12e-6, 1e-6};
  RigidCut along_x(tool, aluminium(), radius), turned(tool, aluminium(), radius);
  const double feed = 4e-5, angle = 0.7;
  along_x.engage({{0.3, 2.5, 2e-3}}, {{feed, 0.0}});
  // Immersion angles are clockwise, and so is the rotation.
  turned.engage({{0.3 + angle, 2.5 + angle, 2e-3}}, {{feed * std::cos(angle), -feed * std::sin(angle)}});
  for (int i = 0; i < 100; ++i) {
    const CuttingForce f = along_x.at(0.0631 * i), t = turned.at(0.0631 * i + angle);
    const CuttingForce back{t.fx * std::cos(angle) - t.fy * std::sin(angle),
                            t.fx * std::sin(angle) + t.fy * std::cos(angle), t.fz, t.torque};
    EXPECT_LT(largestDifference(f, back, tool.radius()), 0.01);  // the nodes of the tables differ
  }
}

TEST(RigidCut, aSingleToothMeetsItsOwnSurfaceWhateverItsRadius) {
  const Engagement cut{0.0, PI, 2e-3, 6e-5};
  RigidCut plain(mill(1, 30.0), aluminium(), cut), offset(mill(1, 30.0), aluminium(), cut, {25e-6});
  for (int i = 0; i < 50; ++i) EXPECT_EQ(plain.at(0.1 * i).fy, offset.at(0.1 * i).fy);
}

TEST(RigidCut, cutsNothingWithoutFeed) {
  Engagement cut{0.0, PI, 2e-3, 0.0};
  RigidCut plain(mill(4, 30.0), aluminium(), cut),
      offset(mill(4, 30.0), aluminium(), cut, {0.0, 5e-6, -3e-6, 9e-6});
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(size(plain.at(0.1 * i)), 0.0);
    EXPECT_EQ(size(offset.at(0.1 * i)), 0.0);
  }
}

// There is no chip behind the tool, though the arc extends there.
TEST(RigidCut, cutsNothingBehindTheTool) {
  const std::vector<double> radius{0.0, 5e-6, -3e-6, 9e-6};
  RigidCut half(mill(4, 0.0), aluminium(), Engagement{0.0, PI, 2e-3, 6e-5}, radius);
  RigidCut whole(mill(4, 0.0), aluminium(), Engagement{0.0, TWO_PI, 2e-3, 6e-5}, radius);
  for (int i = 0; i < 200; ++i) {
    const double angle = 0.01 + 0.0311 * i;
    // Near the walls a tooth of larger radius touches the surface of an earlier one.
    bool at_wall = false;
    for (int j = 0; j < 4; ++j) at_wall = at_wall || std::abs(std::sin(angle + 0.5 * PI * j)) < 0.3;
    if (at_wall) continue;
    EXPECT_NEAR(whole.at(angle).fy, half.at(angle).fy, 1e-9);
  }
}

TEST(RigidCut, aStraightEdgeIsTheLimitOfASmallHelix) {
  const std::vector<double> radius{0.0, 5e-6, -3e-6, 9e-6};
  const Engagement cut{0.3, 2.6, 2e-3, 6e-5};
  RigidCut straight(mill(4, 0.0), aluminium(), cut, radius), little(mill(4, 0.05), aluminium(), cut, radius);
  for (int i = 0; i < 40; ++i) {
    const double angle = 0.41 + TWO_PI * i / 40.0;
    EXPECT_LT(largestDifference(straight.at(angle), little.at(angle), 9.525e-3), 0.25);  // lag of 2e-4 rad
  }
}

TEST(RigidCut, aThinArcHasItsShareOfTheForce) {
  const double middle = 1.1, width = 1e-3;
  const std::vector<double> radius{0.0, 5e-6, -3e-6, 9e-6};
  RigidCut whole(mill(4, 30.0), aluminium(), Engagement{0.0, PI, 2e-3, 6e-5}, radius);
  RigidCut thin(mill(4, 30.0), aluminium(), Engagement{middle, middle + width, 2e-3, 6e-5}, radius);
  double torque = 0.0;
  for (int j = 0; j < 4; ++j) {
    const double chip = whole.chip(j, middle + 0.5 * width);
    if (chip > 0.0) torque += 9.525e-3 * (796e6 * chip + 27.7e3) * 2e-3 * width / TWO_PI;
  }
  const auto [chip, edge] = thin.meanTerms();
  EXPECT_NEAR((chip.torque + edge.torque) / torque, 1.0, 1e-6);
}

// The work of a revolution is Ktc times the removed volume: feed per revolution x width x depth. Where the
// surface is not that of the last pass, the roundness of the tool adds a share of the order of feed over
// radius.
TEST(RigidCut, theWorkEqualsThatOfTheRemovedVolume) {
  CuttingLaw law;
  law.coefficients.ktc = 800e6;
  const Engagement cut{0.3, 2.6, 2e-3, 5e-5};
  const double feed = 4 * cut.feed_per_tooth, radius = 9.525e-3;
  const double volume = feed * radius * (std::cos(cut.entry) - std::cos(cut.exit)) * cut.axial_depth;
  const auto work = [&](const std::vector<double>& offset) {
    return TWO_PI *
           RigidCut(mill(4, 30.0, {80.0, 100.0, 85.0, 95.0}), law, cut, offset).meanTerms()[0].torque;
  };
  EXPECT_NEAR(work({}) / (800e6 * volume), 1.0, 1e-6);
  // Each tooth still meets the last pass.
  EXPECT_NEAR(work({1e-6, 2e-6, -2e-6, 0.0}) / (800e6 * volume), 1.0, 1e-6);
  const double uneven = work({0.0, 25e-6, -10e-6, 40e-6}) / (800e6 * volume);
  EXPECT_GT(uneven, 1.0);
  EXPECT_LT(uneven, 1.0 + feed / radius);
}

// True paths of the teeth, trochoids: the surface on the ray from the tool's centre is the outermost of all
// their intersections with it. Compared with this the rule takes h_1 as c sin(phi) and a tooth's rotation as
// that of the spindle, which neglects F_1^2 cos^2(phi) / (2 R) and F F_n sin(phi) cos(phi) / R, F the feed
// per radian. The roundness of the tool is sixteen times the first of these where a tooth meets its own
// surface of the revolution before.
TEST(RigidCut, chipsAreThoseOfTheTrochoids) {
  const int teeth = 4;
  const double radius = 9.525e-3, feed = 3e-5, per_rad = teeth * feed / TWO_PI;
  const std::vector<double> offset{20e-6, 0.0, 3e-6, -1e-6};
  RigidCut rigid(mill(teeth, 0.0), aluminium(), Engagement{0.0, PI, 1e-3, feed}, offset);
  // With the true path the neglected term is F_n^2 f / R^2, f the feed per radian.
  RigidCut by_path(mill(teeth, 0.0), aluminium(), offset, 1.0);
  by_path.engage({{0.0, PI, 1e-3}}, {{per_rad, 0.0}});
  int older = 0;
  for (int j = 0; j < teeth; ++j) {
    for (double phi = 0.002; phi < PI; phi += 0.0131) {
      const double s = std::sin(phi), c = std::cos(phi);
      // At this time tooth j is at phi and the tool's centre at 0.
      double reach = 0.0;
      int nearest = 0;
      for (int n = 1; n <= 60; ++n) {
        const double pitches = TWO_PI * n / teeth,
                     r = radius + offset[static_cast<std::size_t>((j + n) % teeth)];
        double turned = -pitches, along = 0.0;
        for (int i = 0; i < 50; ++i) {
          const double theta = phi + turned + pitches;
          const double x = per_rad * turned + r * std::sin(theta), y = r * std::cos(theta);
          along = x * s + y * c;
          turned -= (x * c - y * s) / r;  // until it crosses the ray
        }
        if (along > reach) reach = along, nearest = n;
      }
      const double chip = radius + offset[static_cast<std::size_t>(j)] - reach;
      older += nearest == teeth;
      const double left_out =
          feed * feed * c * c / (2.0 * radius) + per_rad * teeth * feed * std::abs(s * c) / radius;
      EXPECT_NEAR(rigid.chip(j, phi), chip, left_out + 2e-9) << j << " " << phi << " " << nearest;
      const double turn = teeth * feed;
      EXPECT_NEAR(by_path.chip(j, phi), chip, 2.0 * turn * turn * per_rad / (radius * radius) + 1e-10)
          << j << " " << phi << " " << nearest;
    }
  }
  EXPECT_GT(older, 20);
}

TEST(RigidCut, acceptsAnotherDepthAndRejectsInvalidArcs) {
  const Engagement cut{0.0, PI, 2e-3, 6e-5};
  RigidCut shallow(mill(4, 30.0), aluminium(), cut);
  Engagement more = cut;
  more.axial_depth = 3e-3;
  RigidCut deep(mill(4, 30.0), aluminium(), more);
  shallow.setDepths({3e-3});
  EXPECT_NEAR(shallow.at(1.0).fy, deep.at(1.0).fy, 1e-9);
  EXPECT_THROW(shallow.engage({{0.0, PI, 0.0}}, {{1e-5, 0.0}}), Error);
  EXPECT_THROW(shallow.engage({{0.5, 0.5, 1e-3}}, {{1e-5, 0.0}}), Error);
  EXPECT_THROW(shallow.engage({{0.0, 7.0, 1e-3}}, {{1e-5, 0.0}}), Error);
  EXPECT_THROW(RigidCut(mill(2, 0.0), aluminium(), std::vector<double>{1e-6}), Error);
}

}  // namespace
}  // namespace smartmill
