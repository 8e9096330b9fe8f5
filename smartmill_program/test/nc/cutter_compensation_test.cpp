// Radius compensation against closed forms: offset of squares, circles and convex polygons.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <sstream>

#include <gmock/gmock.h>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_program/nc/program_reader.h"

namespace smartmill::program {
namespace {

using units::MM;
using units::PI;

constexpr double EXACT = 1e-9;  // [m] rounding

std::vector<Move> movesOf(const std::string& text, double radius_mm = 5.0) {
  ReaderOptions options;
  options.radius_offsets[1] = radius_mm * MM;
  return interpretProgram(text, "part.nc", options);
}

std::string faultOf(const std::string& text, double radius_mm = 5.0) {
  return errorOf([&] { movesOf(text, radius_mm); });
}

void expectPoint(const nc::PathSegment::Point& point, double x, double y, double z = -1.0) {
  EXPECT_NEAR(point[0], x * MM, EXACT);
  EXPECT_NEAR(point[1], y * MM, EXACT);
  EXPECT_NEAR(point[2], z * MM, EXACT);
}

void expectContinuous(const std::vector<Move>& moves) {
  for (std::size_t i = 1; i < moves.size(); ++i)
    for (std::size_t a = 0; a < 3; ++a)
      EXPECT_NEAR(moves[i].path.start()[a], moves[i - 1].path.target()[a], EXACT) << "move " << i;
}

double lengthOf(const std::vector<Move>& moves) {
  double sum = 0.0;
  for (const Move& move : moves) sum += move.path.length();
  return sum;
}

const std::string START = "G21 G90 G17 G40 G0 X-20 Y-20\nZ-1 S3000 M3 F600\n";

// Around a square of 40 mm: four lines of 40 mm and four quarter circles, less the corner at which path
// begins and ends.
TEST(CutterCompensation, SquareOutside) {
  const auto moves = movesOf(START + "G1 G41 D1 X0 Y-10\nY40\nX40\nY0\nX-10\nG40 X-20 Y-20\nM30\n");
  expectContinuous(moves);
  ASSERT_EQ(moves.size(), 9u);
  expectPoint(moves[0].path.start(), -20, -20);
  expectPoint(moves[0].path.target(), -5, -10);
  expectPoint(moves[1].path.target(), -5, 40);
  EXPECT_TRUE(moves[2].path.isArc());
  EXPECT_EQ(moves[2].line, 4);  // the arc belongs to the block before the corner
  expectPoint(moves[2].path.target(), 0, 45);
  expectPoint(moves[4].path.target(), 45, 40);
  expectPoint(moves[7].path.target(), -10, -5);
  expectPoint(moves[8].path.target(), -20, -20);
  const double lead = std::hypot(15, 10) + std::hypot(10, 15);
  EXPECT_NEAR(lengthOf(moves), (lead + 50 + 40 + 40 + 50 + 3 * 0.5 * PI * 5) * MM, EXACT);
}

// In a square of 40 mm the path is a square of 30 mm; the tool plunges behind the start-up move.
TEST(CutterCompensation, SquareInside) {
  const auto moves = movesOf(
      "G21 G90 G0 X20 Y20\nZ5 S3000 M3 F600\nG42 D1 X20 Y0\nG1 Z-1\nX0\nY40\nG4 P10\nX40\nY0\n"
      "X20\nG0 Z5\nG40 Y20\nM30\n");
  expectContinuous(moves);
  ASSERT_EQ(moves.size(), 10u);
  expectPoint(moves[0].path.target(), 20, 5, 5);
  expectPoint(moves[1].path.target(), 20, 5, -1);
  expectPoint(moves[2].path.target(), 5, 5);
  expectPoint(moves[3].path.target(), 5, 35);
  EXPECT_EQ(moves[4].dwell, 0.01);
  expectPoint(moves[4].path.target(), 5, 35);
  expectPoint(moves[5].path.target(), 35, 35);
  expectPoint(moves[6].path.target(), 35, 5);
  expectPoint(moves[7].path.target(), 20, 5);
  expectPoint(moves[8].path.target(), 20, 5, 5);
  expectPoint(moves[9].path.target(), 20, 20, 5);
}

// A circle of radius 20 mm: 15 mm within, 25 mm outside; a helix keeps its pitch.
TEST(CutterCompensation, Circles) {
  const auto pocket =
      movesOf("G21 G90 G0 X0 Y0\nZ-1 S3000 M3 F600\nG1 G41 D1 X20\nG3 I-20\nG1 G40 X0\nM30\n");
  ASSERT_EQ(pocket.size(), 3u);
  expectPoint(pocket[0].path.target(), 15, 0);
  EXPECT_NEAR(pocket[1].path.length(), 2 * PI * 15 * MM, EXACT);
  expectPoint(pocket[1].path.target(), 15, 0);
  expectPoint(pocket[2].path.target(), 0, 0);
  const auto boss =
      movesOf("G21 G90 G0 X40 Y0\nZ-1 S3000 M3 F600\nG1 G42 D1 X20\nG3 I-20 Z-2\nG1 G40 X40\nM30\n");
  ASSERT_EQ(boss.size(), 3u);
  expectPoint(boss[0].path.target(), 25, 0);
  expectPoint(boss[1].path.target(), 25, 0, -2);
  EXPECT_NEAR(boss[1].path.length(), std::hypot(2 * PI * 25, 1.0) * MM, EXACT);
}

// Inside corner of the line y = 0 and an arc about (10, 10): y = 5 and (x - 10)^2 + 25 = (10 sqrt 2 - 5)^2. A
// tangent arc needs no corner.
TEST(CutterCompensation, LinesAndArcs) {
  const auto corner = movesOf(START + "G41 D1 G1 X-10 Y0\nX20\nG3 X0 Y20 I-10 J10\nG40 G1 X0 Y30\nM30\n");
  expectContinuous(corner);
  ASSERT_EQ(corner.size(), 4u);
  const double r = 10 * std::sqrt(2.0) - 5;
  expectPoint(corner[1].path.target(), 10 + std::sqrt(r * r - 25), 5);
  EXPECT_NEAR(corner[2].path.radius(), r * MM, EXACT);
  const auto tangent = movesOf(START + "G41 D1 G1 X-10 Y0\nX20\nG3 X40 Y20 J20\nG1 Y30\nG40 X30\nM30\n");
  expectContinuous(tangent);
  ASSERT_EQ(tangent.size(), 5u);
  expectPoint(tangent[1].path.target(), 20, 5);
  EXPECT_NEAR(tangent[2].path.length(), 0.5 * PI * 15 * MM, EXACT);
  // Two arcs: circles of 15 mm about (0, 0) and (20, 0) meet at x = 10.
  const auto arcs = movesOf(
      "G21 G90 G0 X-30 Y-5\nZ-1 S3000 M3 F600\nG41 D1 G1 X-20 Y0\nG2 X10 Y17.3205 I20\nG2 X40 "
      "Y0 I10 J-17.3205\nG40 G1 X50\nM30\n",
      2.0);
  expectContinuous(arcs);
  ASSERT_EQ(arcs.size(), 4u);
  EXPECT_NEAR(arcs[1].path.target()[0], 10 * MM, 1e-6);  // the program has four decimals
  EXPECT_NEAR(arcs[1].path.target()[1], std::sqrt(22.0 * 22 - 100) * MM, 1e-6);
}

// The words of the dialect: D before, D0, the radius of the tool, a side of a program that ends under
// compensation.
TEST(CutterCompensation, RadiusOffsets) {
  EXPECT_EQ(movesOf(START + "G1 G41 D0 X0 Y0\nX10\nM30\n")[1].path.start()[1], 0.0);
  const auto before = movesOf(START + "D1\nG42 G1 X0 Y0\nX10\nM30\n");
  expectPoint(before[1].path.start(), 0, -5);
  expectPoint(before[1].path.target(), 10, -5);
  ReaderOptions options;
  options.tool_radius = [](int tool) { return tool == 3 ? 2 * MM : 0.0; };
  const auto of_tool =
      interpretProgram("T3 M6\n" + START + "G42 D1 G1 X0 Y0\nX10\nM30\n", "part.nc", options);
  expectPoint(of_tool[1].path.target(), 10, -2);
}

double distanceToSegment(double x, double y, const std::array<double, 2>& a, const std::array<double, 2>& b) {
  const double dx = b[0] - a[0], dy = b[1] - a[1];
  const double t = std::clamp(((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy), 0.0, 1.0);
  return std::hypot(x - a[0] - t * dx, y - a[1] - t * dy);
}

// Around a convex polygon the tool axis is at the radius from it everywhere; in it at least, and somewhere in
// each line exactly.
TEST(CutterCompensation, ConvexPolygons) {
  std::mt19937_64 random(41);
  for (int n = 0; n < 60; ++n) {
    const int corners = 3 + n % 6;
    std::uniform_real_distribution<double> jitter(-0.3, 0.3);
    std::vector<std::array<double, 2>> points;  // [mm] counterclockwise on a circle of 40 mm
    for (int k = 0; k < corners; ++k) {
      const double angle = 2 * PI * (k + jitter(random)) / corners;
      points.push_back({std::round(4e4 * std::cos(angle)) / 1e3, std::round(4e4 * std::sin(angle)) / 1e3});
    }
    for (const bool outside : {true, false}) {
      const auto middle = [&](std::size_t k) {
        const auto &a = points[k], &b = points[(k + 1) % points.size()];
        return formatted("X%.4f Y%.4f", 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]));
      };
      std::string text = outside ? "G21 G90 G0 X100 Y100\nZ-1 S3000 M3 F600\nG42 D1 G1 " + middle(0) + "\n"
                                 : "G21 G90 G0 X0 Y0\nZ-1 S3000 M3 F600\nG41 D1 G1 " + middle(0) + "\n";
      for (std::size_t k = 1; k <= points.size(); ++k)
        text += formatted("X%.3f Y%.3f\n", points[k % points.size()][0], points[k % points.size()][1]);
      text += middle(0) + "\nG40 X0 Y0\nM30\n";
      const auto moves = movesOf(text, 3.0);
      expectContinuous(moves);
      for (std::size_t i = 1; i + 1 < moves.size(); ++i) {
        double least = 1.0, most = 0.0;
        for (const double share : {0.0, 0.25, 0.5, 0.75, 1.0}) {
          const auto point = moves[i].path.at(share * moves[i].path.length());
          double distance = 1e9;
          for (std::size_t k = 0; k < points.size(); ++k)
            distance = std::min(distance, distanceToSegment(point[0] / MM, point[1] / MM, points[k],
                                                            points[(k + 1) % points.size()]));
          least = std::min(least, distance * MM);
          most = std::max(most, distance * MM);
        }
        EXPECT_NEAR(least, 3 * MM, 2e-7) << text;  // the middle of a side has four decimals
        if (outside) {
          EXPECT_NEAR(most, 3 * MM, 2e-7) << text;
        }
      }
    }
  }
}

/// A path of lines and arcs with corners of 5 to 100 degrees (LinuxCNC has no arc at flatter ones), whose
/// start-up move is in line with the first motion: there LinuxCNC and a Fanuc control agree.
std::string randomPath(std::mt19937_64& random) {
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  double x = 0.0, y = 0.0, heading = uniform(-PI, PI);
  std::string text = "G21 G90 G17 G40 G64\nT1 M6\nG0 X0 Y0 Z-1\nS3000 M3 F600\n";
  const auto line = [&](double length) {
    x += length * std::cos(heading);
    y += length * std::sin(heading);
    text += formatted("G1 X%.6f Y%.6f\n", x, y);
  };
  text += uniform(0.0, 1.0) < 0.5 ? "G41 D1\n" : "G42 D1\n";
  line(20.0);
  line(20.0);
  for (int k = 0; k < 8; ++k) {
    heading += (uniform(0.0, 1.0) < 0.5 ? -1.0 : 1.0) * uniform(5.0, 100.0) * PI / 180.0;
    if (uniform(0.0, 1.0) < 0.5) {
      line(uniform(20.0, 40.0));
      continue;
    }
    const double side = uniform(0.0, 1.0) < 0.5 ? 1.0 : -1.0, radius = uniform(15.0, 30.0),
                 sweep = side * uniform(1.0, 2.5);
    const double cx = x - side * radius * std::sin(heading), cy = y + side * radius * std::cos(heading);
    const double i = cx - x, j = cy - y, end = std::atan2(y - cy, x - cx) + sweep;
    x = cx + radius * std::cos(end);
    y = cy + radius * std::sin(end);
    heading += sweep;
    text += formatted("%s X%.6f Y%.6f I%.6f J%.6f\n", side > 0.0 ? "G3" : "G2", x, y, i, j);
  }
  line(20.0);
  return text + "G40 G1 X0 Y0\nM30\n";
}

// LinuxCNC's interpreter (rs274) prints the path of the tool axis with four decimals. Where it refuses a
// path, as one whose arc the corners shorten to nothing, there is nothing to compare.
TEST(CutterCompensation, PathOfLinuxCnc) {
  if (std::system("command -v rs274 >/dev/null 2>&1") != 0) GTEST_SKIP() << "rs274 is not installed";
  const TemporaryFolder folder;
  folder.write("tool.tbl", formatted("T1 P1 D%.12f\n", 6.0 / 25.4));  // in inches
  std::mt19937_64 random(42);
  int compared = 0;
  for (int n = 0; n < 40; ++n) {
    const std::string text = randomPath(random);
    folder.write("part.ngc", text);
    const std::string run =
        "cd '" + folder.file(".") + "' && HOME=$PWD rs274 -t tool.tbl -g part.ngc >out 2>err </dev/null";
    if (std::system(run.c_str()) != 0) continue;
    std::istringstream in(readText(folder.file("out")));
    std::vector<std::array<double, 2>> ends;
    for (std::string line; std::getline(in, line);) {
      std::array<double, 2> end{};
      const std::size_t at = line.find("_FEED(");
      if (at != std::string::npos && std::sscanf(line.c_str() + at, "_FEED(%lf, %lf", &end[0], &end[1]) == 2)
        ends.push_back(end);
    }
    if (readText(folder.file("out")).find("PROGRAM_END") == std::string::npos) continue;
    std::vector<std::array<double, 2>> own;
    for (const Move& move : movesOf(text, 3.0))
      if (!move.rapid) own.push_back({move.path.target()[0] / MM, move.path.target()[1] / MM});
    ASSERT_EQ(own.size(), ends.size()) << text;
    for (std::size_t k = 0; k < own.size(); ++k) {
      EXPECT_NEAR(own[k][0], ends[k][0], 2e-4) << "end " << k << " of\n" << text;
      EXPECT_NEAR(own[k][1], ends[k][1], 2e-4) << "end " << k << " of\n" << text;
    }
    ++compared;
  }
  EXPECT_GT(compared, 20);
}

TEST(CutterCompensation, NamesTheLineOfAFault) {
  const std::string line = "part.nc: line ";
  struct Case {
    std::string text, fault;
  };
  for (const Case& c : std::vector<Case>{
           {"G41 G1 X0 Y0\nM30\n", "3, column 1: G41 without D, expected the number of a radius offset"},
           {"G18 G41 D1 X0\nM30\n", "3, column 5: G41 in G18 or G19, expected G17"},
           {"G41 D1 G3 X0 Y0 R50\nM30\n",
            "3, column 8: G3 as the start-up move of radius compensation, expected G0 or G1"},
           {"G41 D1 G1 X0 Y0\nX50\nG40 G3 X60 Y10 R10\nM30\n",
            "5, column 5: G3 as the cancelling move of radius compensation, expected G0 or G1"},
           {"G41 D1 G1 X0 Y0\nG42 X50\nM30\n",
            "4, column 1: G42 under radius compensation, expected G40 before it"},
           {"G41 D1 G1 X0 Y0\nD2\nM30\n",
            "4, column 1: D2 under radius compensation, expected G40 before it"},
           {"G41 D1 G1 X0 Y0\nT2 M6\nM30\n",
            "4, column 4: M6 under radius compensation, expected G40 before it"},
           {"G41 D1 G1 X0 Y0\nG81 X5 Z-3 R1\nM30\n",
            "4, column 1: G81 under radius compensation, expected G40 before it"},
           {"G41 D1 G1 X0 Y0\nX10\nG91 G28 Z0\nG90\nG28 X0\nM30\n",
            "7, column 1: radius compensation is active, expected G40 before this block"},
           // A slot of 8 mm for a tool of 10 mm, and an inner arc of 4 mm.
           {"G41 D1 G1 X0 Y0\nX50\nY8\nX0\nG40 Y20\nM30\n",
            "6, column 1: radius compensation: a radius offset of 5 mm is larger than the path permits "
            "(interference) in line 5"},
           {"G41 D1 G1 X0 Y0\nX50\nG3 X54 Y4 J4\nG40 G1 Y20\nM30\n",
            "5, column 1: radius compensation: radius offset of 5 mm in an arc of 4 mm in line 5"}})
    EXPECT_EQ(faultOf(START + c.text), line + c.fault) << c.text;
}

}  // namespace
}  // namespace smartmill::program
