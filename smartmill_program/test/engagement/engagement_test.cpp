// Engagement and volume of programs against closed forms, with a tool of 10 mm and columns of 0.1 mm: angles
// within 0.05 degrees, volumes within 0.1 %.

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

#include "simulated_cut.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::degFromRad;
using units::MM;
using units::PI;
using units::radFromDeg;

constexpr double R = 5.0;        // [mm] tool radius
constexpr double ANGLE = 0.05;   // [deg] tolerance: bisection to 0.008
constexpr double VOLUME = 1e-3;  // [1] tolerance: steps of 0.3 mm where the tool enters and leaves

/// A program in a block of 60 x 40 x 10 mm.
struct Cut : SimulatedCut {
  explicit Cut(const std::string& text, double resolution = 0.1)
      : SimulatedCut(text, ToolProfile(R * MM), BLOCK, resolution) {}

  /// Expects one arc in every step of a line for which `applies`, with these angles [deg] and depth [mm].
  void expectArc(int line, const std::function<bool(const Step&)>& applies,
                 const std::function<std::array<double, 3>(const Step&)>& arc) const {
    int count = 0;
    for (const Step& step : steps) {
      if (step.move->line != line || !applies(step)) continue;
      ++count;
      const auto [entry, exit, depth] = arc(step);
      ASSERT_EQ(step.contact.arcs.size(), 1u) << step.tip[0] / MM << " " << step.tip[1] / MM;
      EXPECT_NEAR(degFromRad(step.contact.entry()), entry, ANGLE)
          << step.tip[0] / MM << " " << step.tip[1] / MM;
      EXPECT_NEAR(degFromRad(step.contact.exit()), exit, ANGLE)
          << step.tip[0] / MM << " " << step.tip[1] / MM;
      EXPECT_NEAR(step.contact.axialDepth() / MM, depth, 1e-3) << step.tip[0] / MM << " " << step.tip[1] / MM;
    }
    EXPECT_GT(count, 5);
  }
};

bool always(const Step&) {
  return true;
}

TEST(Engagement, Slot) {
  const Cut cut("G0 X-10 Y20.03 Z-2\nG1 X70\n");
  cut.expectArc(
      3, [](const Step& s) { return s.tip[0] > 0 && s.tip[0] < 55 * MM; },
      [](const Step&) {
        return std::array<double, 3>{0, 180, 2};
      });
  EXPECT_NEAR(cut.volume(), 60 * 10 * 2, VOLUME * 1200);
  // Before the tool reaches the block it is in air.
  EXPECT_TRUE(cut.steps.front().air());
}

/// Two passes at an angle to the columns, the second next to the first: the closed form is cos(phi) = 1 - ae
/// / R.
void expectStepOver(double direction, double radial, bool down, double resolution = 0.1) {
  const double c = std::cos(radFromDeg(direction)), s = std::sin(radFromDeg(direction));
  // The second pass is on the right of the first one for material on its right (down-milling), else on its
  // left.
  const double side = down ? -radial : radial, half = 9.0;
  const auto at = [&](double along, double across) {
    return formatted("X%.6f Y%.6f", 30 + along * c - across * s, 20 + along * s + across * c);
  };
  const Cut cut("G0 " + at(-half, 0) + " Z5\nG1 Z-3\nG1 " + at(half, 0) + "\nG0 Z5\nG0 " + at(-half, side) +
                    "\nG1 Z-3\nG1 " + at(half, side) + "\n",
                resolution);
  const double arc = degFromRad(std::acos(1.0 - radial / R));
  const auto in_the_middle = [&](const Step& step) {  // away from the ends of the first pass
    return std::abs((step.tip[0] / MM - 30) * c + (step.tip[1] / MM - 20) * s) < 3.0;
  };
  cut.expectArc(8, in_the_middle, [&](const Step&) {
    return down ? std::array<double, 3>{180 - arc, 180, 3} : std::array<double, 3>{0, arc, 3};
  });
  for (const Step& step : cut.steps) {
    if (step.move->line == 8 && in_the_middle(step)) {
      EXPECT_NEAR(step.contact.radialDepth() / MM, radial, 0.01);
    }
  }
}

// Entry and exit of the block at any phase of the steps.
TEST(Engagement, VolumeOfShortSlots) {
  for (int k = 0; k < 8; ++k) {
    const Cut cut(formatted("G0 X%.3f Y20 Z-2\nG1 X70\n", -8.0 - 0.05 * k));
    EXPECT_NEAR(cut.volume(), 1200, 2 * 2 * 0.0092 * R * R + 1e-6 * 1200);
  }
}

TEST(Engagement, HalfImmersionUpAndDown) {
  for (const double direction : {0.0, 27.0, 90.0, 200.0}) {
    expectStepOver(direction, 5.0, true);
    expectStepOver(direction, 5.0, false);
  }
}

TEST(Engagement, SmallRadialDepthsUpAndDown) {
  for (const double radial : {0.02, 0.25, 1.0, 2.5, 7.5, 9.5}) {
    expectStepOver(27.0, radial, true);
    expectStepOver(0.0, radial, false);
  }
}

// The walls are those of the sweeps, not of the columns.
TEST(Engagement, AnglesDoNotDependOnTheResolution) {
  for (const double resolution : {0.2, 0.5}) {
    expectStepOver(27.0, 1.0, true, resolution);
    expectStepOver(200.0, 5.0, false, resolution);
  }
}

// A left-hand tool (M4) on the same path: down-milling becomes up-milling.
TEST(Engagement, LeftHandTool) {
  const Cut cut("M4\nG0 X-10 Y40 Z-2\nG1 X70\n");
  cut.expectArc(
      4, [](const Step& s) { return s.tip[0] > 0 && s.tip[0] < 55 * MM; },
      [](const Step&) {
        return std::array<double, 3>{0, 90, 2};
      });
}

// The first contour has the wall of its corner at the inside of a turn from +x to +y about (x0, y0); the
// second is shifted by ae towards both walls. d: distance of the tool beyond x0. Closed form: see each case.
TEST(Engagement, InsideCornerOfARightAngle) {
  constexpr double X0 = 40.03, Y0 = 15.04, AE = 1.0;
  const Cut cut(
      formatted("G0 X10 Y%.2f Z5\nG1 Z-3\nG1 X%.2f\nG1 Y30\nG0 Z5\nG0 X10 Y%.2f\nG1 Z-3\nG1 X%.2f\nG1 Y30\n",
                Y0, X0, Y0 - AE, X0 + AE));
  cut.expectArc(
      9, [](const Step& s) { return s.tip[0] / MM > X0 - 10; },
      [](const Step& s) {
        const double d = s.tip[0] / MM - X0;
        // Along the first wall: cos(phi) = -(1 - ae / R). There the point at entry is in front of x0 while d
        // < -R sin(phi).
        const double straight = std::acos(-(1 - AE / R));
        if (d < -R * std::sin(straight)) return std::array<double, 3>{degFromRad(straight), 180, 3};
        // Up to the second wall: from the disc about (x0, y0), cos(phi + delta) = rho / 2R in polar
        // coordinates of the distance (d, ae) of the two centres.
        const double rho = std::hypot(d, AE), disc = std::acos(rho / (2 * R)) - std::atan2(d, AE);
        // The second wall, x = x0 + R: sin(phi) = 1 - d / R, for points above y0, cos(phi) > ae / R.
        const double wall = std::asin(std::min(1.0, 1 - d / R));
        const double entry = std::cos(wall) > AE / R ? wall : disc;
        return std::array<double, 3>{degFromRad(entry), 180, 3};
      });
  // After the turn it cuts the second wall like the first.
  cut.expectArc(
      10, [](const Step& s) { return s.tip[1] / MM > Y0 + 2 && s.tip[1] / MM < 24; },
      [](const Step&) {
        return std::array<double, 3>{degFromRad(std::acos(-(1 - AE / R))), 180, 3};
      });
}

// Circles of growing radius in a pocket, counterclockwise: the wall is on the right, down-milling. Law of
// cosines in the triangle of both centres and the point at entry: cos(phi) = (r2^2 + R^2 - (r1 + R)^2) / (2
// r2 R).
TEST(Engagement, CircularPocket) {
  constexpr double R1 = 4.0, R2 = 6.0, H = 3.0;
  const Cut cut("G0 X30 Y20 Z1\nG1 Z-3\nG1 X34\nG3 I-4 J0\nG1 X36\nG3 I-6 J0\n");
  const double entry = std::acos((R2 * R2 + R * R - (R1 + R) * (R1 + R)) / (2 * R2 * R));
  cut.expectArc(
      7,
      [](const Step& s) {
        // Away from the start, where the line to the second circle has cut.
        return s.tip[0] / MM - 30 < 2.0;
      },
      [&](const Step&) {
        return std::array<double, 3>{degFromRad(entry), 180, H};
      });
  EXPECT_NEAR(cut.volume(), PI * (R2 + R) * (R2 + R) * H, VOLUME * PI * (R2 + R) * (R2 + R) * H);
  EXPECT_NEAR(cut.columnVolume(), PI * (R2 + R) * (R2 + R) * H, VOLUME * PI * (R2 + R) * (R2 + R) * H);
}

// From the surface down to 3 mm over 30 mm in full material: the front of the tool cuts its whole width and
// the end face all its area. Lowest tip over a point at x from the start: slope min(L, x + w), w^2 = R^2 -
// y^2.
TEST(Engagement, Ramp) {
  constexpr double L = 30.0, SLOPE = 0.1;
  const Cut cut("G0 X15 Y20.03 Z0\nG1 X45 Z-3\n");
  cut.expectArc(3, always, [](const Step& s) { return std::array<double, 3>{0, 180, -s.tip[2] / MM}; });
  const double volume = SLOPE * L * L * R + SLOPE * L * PI * R * R;
  EXPECT_NEAR(cut.volume(), volume, VOLUME * volume);
  EXPECT_NEAR(cut.columnVolume(), volume, 3 * VOLUME * volume);  // columns do not divide at the wall
}

// Helix into full material, then a full circle at its bottom: a bore of radius r + R.
TEST(Engagement, Helix) {
  const Cut cut("G0 X34 Y20 Z0\nG3 Z-1 I-4\nG3 Z-2 I-4\nG3 Z-3 I-4\nG3 I-4\n");
  const double volume = PI * 81 * 3;
  EXPECT_NEAR(cut.volume(), volume, VOLUME * volume);
  // A step after a full turn: the material in front is what the turn before has left, 1 mm higher less what
  // the tool itself has cut; within the bore no arc is deeper.
  for (const Step& step : cut.steps)
    if (step.move->line == 4 || step.move->line == 5) {
      EXPECT_LT(step.contact.axialDepth(), 1.001 * MM);
    }
}

TEST(Engagement, DrilledVolume) {
  const Cut cut("G0 X0 Y0 Z10\nG81 X20.02 Y20.05 Z-5 R1\nG83 X40.03 Y20.01 Z-8 R1 Q2\nG80\n");
  EXPECT_NEAR(cut.volume(), PI * R * R * 13, VOLUME * PI * R * R * 13);
  for (const Step& step : cut.steps) {
    EXPECT_TRUE(step.contact.empty());
    EXPECT_FALSE(step.move->rapid && !step.air())
        << step.move->line;  // retracts and returns into its own hole
  }
}

// Circles of radius r + R = 8 mm, 1 mm apart along x, joined by lines at their lowest y: two half circles and
// a slot of 16 mm, less the scallops between the circles on the side without lines.
TEST(Engagement, Trochoid) {
  std::string text = "G0 X20 Y20 Z5\nG1 Z-4\nG91\n";
  for (int k = 0; k < 10; ++k) text += "G3 X0 Y0 I0 J3\nG1 X1\n";
  text += "G3 X0 Y0 I0 J3\n";
  const Cut cut(text);
  const double scallop = 8.0 - (0.5 * std::sqrt(64 - 0.25) + 64 * std::asin(0.5 / 8.0));
  const double volume = 4.0 * (PI * 64 + 16 * 10 - 10 * scallop);
  EXPECT_NEAR(cut.volume(), volume, VOLUME * volume);
  // A trochoid keeps the immersion well below that of the slot.
  for (const Step& step : cut.steps) {
    if (step.move->line > 12 && !step.contact.empty()) {
      EXPECT_LT(degFromRad(step.contact.exit() - step.contact.entry()), 100.0);
    }
  }
}

// Two levels at once: material of 4 mm on the left half, of 1 mm on the right.
TEST(Engagement, ArcsOfDifferentDepth) {
  const Cut cut("G0 X-10 Y15.02 Z-3\nG1 X70\nG0 Z5\nG0 X-10 Y20.02\nG0 Z-4\nG1 X70\n");
  int count = 0;
  for (const Step& step : cut.steps) {
    if (step.move->line != 7 || step.tip[0] < 0 || step.tip[0] > 55 * MM) continue;
    ++count;
    ASSERT_EQ(step.contact.arcs.size(), 2u);
    EXPECT_NEAR(degFromRad(step.contact.arcs[0].entry), 0, ANGLE);
    EXPECT_NEAR(degFromRad(step.contact.arcs[0].exit), 90, ANGLE);
    EXPECT_NEAR(step.contact.arcs[0].depth(), 4 * MM, 1e-6);
    EXPECT_NEAR(degFromRad(step.contact.arcs[1].exit), 180, ANGLE);
    EXPECT_NEAR(step.contact.arcs[1].depth(), 1 * MM, 1e-6);
  }
  EXPECT_GT(count, 50);
}

// An arc in G18: a groove with the shape of the arc, deepest in its middle.
TEST(Engagement, ArcInAnotherPlane) {
  const Cut cut("G0 X15 Y20 Z0\nG18 G2 X45 Z0 R30\n");  // about (30, +25.98): down to -4.02 at x = 30
  double deepest = 0.0;
  for (const Step& step : cut.steps) deepest = std::min(deepest, step.tip[2] / MM);
  EXPECT_NEAR(deepest, -(30 - std::sqrt(900 - 225)), 0.01);
  EXPECT_NEAR(cut.stock.height(30 * MM, 20 * MM) / MM, -(30 - std::sqrt(900 - 225)), 0.002);
}

// Two computations of one volume: along the path from the engagement, and from the columns that remain.
TEST(Engagement, VolumeAlongRandomPathsIsThatOfTheColumns) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> x(5, 55), y(5, 35), z(-4, 0), r(1, 6);
  for (int program = 0; program < 3; ++program) {
    std::string text = "G0 X30 Y20 Z1\n";
    for (int k = 0; k < 12; ++k) {
      text += formatted("G1 X%.3f Y%.3f Z%.3f\n", x(random), y(random), z(random));
      text += formatted("G%d I%.3f J0 Z%.3f\n", 2 + k % 2, r(random), z(random));
    }
    const Cut cut(text);
    EXPECT_NEAR(cut.volume(), cut.columnVolume(), VOLUME * cut.columnVolume());
  }
}

TEST(Engagement, SecondPassOnTheSamePathIsAir) {
  const Cut cut(
      "G0 X-10 Y20.03 Z-2\nG1 X70 Y22\nG1 X-10 Y20.03\nG3 X-10 Y20.03 I20 J0\nG3 X-10 Y20.03 I20 J0\n");
  for (const Step& step : cut.steps) {
    if (step.move->line == 4) {
      EXPECT_TRUE(step.air());
    }
    if (step.move->line == 6) {
      EXPECT_TRUE(step.air());
    }
  }
}

TEST(Engagement, RapidMovesThatMeetTheStock) {
  const Cut cut("G0 X-10 Y20 Z-2\nG0 X30\nG0 Z5\nG0 X40\nG0 Z-3\n");
  for (const Step& step : cut.steps) {
    const double x = step.tip[0] / MM;
    if (step.move->line == 3 && x > -4) {
      EXPECT_FALSE(step.air()) << x;
    }
    if (step.move->line == 4 || step.move->line == 5) {
      EXPECT_TRUE(step.air());
    }
    if (step.move->line == 6 && step.end[2] < -1e-6) {
      EXPECT_FALSE(step.air());
    }
  }
}

TEST(Engagement, APathOfKilometresIsAnError) {
  EXPECT_EQ(errorOf([] { Cut("G0 X0 Y0 Z-1\nG1 X99999999\n"); }),
            "G1: path of 1e+05 m, expected less than 1e+07 steps");
}

TEST(Engagement, ACutWithTheSpindleAtRestIsAnError) {
  EXPECT_EQ(errorOf([] { Cut("M5\nG0 X-10 Y20 Z-2\nG1 X70\n"); }),
            "G1 cuts with the spindle at rest, expected S and M3 or M4 before it");
}

}  // namespace
}  // namespace smartmill::program
