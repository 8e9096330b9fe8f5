// Ball ends, bull-nose and face mills and stocks of other shapes against closed forms: angles within 0.5
// degrees, volumes within 0.1 %, those of curved edges at the entry of the work, on ramps and over earlier
// passes within 0.5 %.

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>

#include <gtest/gtest.h>

#include "simulated_cut.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_program/stock/triangle_mesh.h"

namespace smartmill::program {
namespace {

using units::degFromRad;
using units::MM;
using units::PI;

constexpr double R = 5.0;        // [mm] tool radius
constexpr double ANGLE = 0.5;    // [deg] tolerance
constexpr double VOLUME = 1e-3;  // [1] tolerance
constexpr double CURVED_VOLUME = 5e-3;

ToolProfile withEdge(double corner_mm, double angle_deg = 90.0) {
  ToolGeometry tool{2, 2 * R * MM, 0.0, {}};
  tool.edge.corner_radius = corner_mm * MM;
  if (angle_deg < 90.0) tool.edge.edge_angle = units::radFromDeg(angle_deg);
  return {tool, 8 * MM};
}

struct Cut : SimulatedCut {
  Cut(const std::string& text, const ToolProfile& profile, const StockShape& shape = BLOCK,
      double resolution = 0.1)
      : SimulatedCut(text, profile, shape, resolution) {}

  /// The step of a line at an X [mm].
  const Step& at(int line, double x) const {
    const auto found = std::find_if(steps.begin(), steps.end(), [&](const Step& step) {
      return step.move->line == line && step.start[0] <= x * MM && step.end[0] > x * MM;
    });
    if (found == steps.end()) throw std::runtime_error("no step");
    return *found;
  }
};

double segmentArea(double depth) {  // [mm2] of a circle
  return R * R * std::acos((R - depth) / R) - (R - depth) * std::sqrt(depth * (2 * R - depth));
}

TEST(ToolProfile, IsThatOfTheEdge) {
  const ToolProfile ball = withEdge(R), bull = withEdge(1.0), face = withEdge(0.8, 45.0),
                    sharp = withEdge(0.0, 60.0);
  EXPECT_NEAR(ball.height(3 * MM) / MM, R - std::sqrt(R * R - 9), 1e-12);
  EXPECT_EQ(bull.height(3.9 * MM), 0.0);
  EXPECT_NEAR(bull.height(4.6 * MM) / MM, 1 - std::sqrt(1 - 0.36), 1e-12);
  EXPECT_NEAR(bull.flatRadius() / MM, 4.0, 1e-12);
  // The extended edge meets the tip at the radius; the arc is tangent to both.
  EXPECT_NEAR(face.height(6 * MM) / MM, 1.0, 1e-12);
  EXPECT_NEAR(face.flatRadius() / MM, 5 - 0.8 * std::tan(PI / 8), 1e-12);
  EXPECT_NEAR(sharp.radiusAt(2 * MM) / MM, 5 + 2 / std::tan(PI / 3), 1e-12);
  for (const ToolProfile& profile : {ball, bull, face, sharp}) {
    for (double z = 0.01; z < profile.top() / MM; z += 0.13) {
      const double r = profile.radiusAt(z * MM);
      EXPECT_NEAR(profile.height(r) / MM, z, 1e-9);
      EXPECT_NEAR(profile.slope(r), (profile.height(r + 1e-9) - profile.height(r - 1e-9)) / 2e-9,
                  2e-3 * profile.slope(r) + 1e-4);
    }
  }
}

TEST(ToolShapes, SlotOfABall) {
  for (const double depth : {0.2, 1.0, 4.0}) {
    const Cut cut(formatted("G0 X-10 Y20.03 Z-%g\nG1 X70\n", depth), withEdge(R));
    const Step& step = cut.at(3, 30);
    ASSERT_EQ(step.contact.arcs.size(), 1u);  // slices with the same angles are one
    EXPECT_NEAR(degFromRad(step.contact.entry()), 0.0, ANGLE);
    EXPECT_NEAR(degFromRad(step.contact.exit()), 180.0, ANGLE);
    EXPECT_NEAR(step.contact.axialDepth() / MM, depth, 5e-3);
    EXPECT_NEAR(step.contact.side_area / (MM * MM * segmentArea(depth)), 1.0, VOLUME);
    EXPECT_NEAR(cut.columnVolume() / (60 * segmentArea(depth)), 1.0, VOLUME);
    EXPECT_NEAR(cut.volume() / cut.columnVolume(), 1.0, CURVED_VOLUME);
  }
}

// Passes at a distance b on a plane: at the height where the tool has the radius r the exit is acos(1 - b /
// r). Each pass removes b times the difference of the mean heights before it, the plane, and behind it,
// scallops of b^2 / (24 R).
TEST(ToolShapes, RasterOfABallOnAPlane) {
  const double depth = 0.4, b = 0.7;
  std::string text = formatted("G0 X-10 Y10 Z-%g\n", depth);
  for (int k = 0; k < 8; ++k) text += formatted("G1 X70\nG0 Z5\nX-10 Y%g\nZ-%g\n", 10 + b * (k + 1), depth);
  const Cut cut(text + "G1 X70\n", withEdge(R));
  const int last = cut.steps.back().move->line;
  const Step& step = cut.at(last, 30);
  int checked = 0;
  for (const EngagedArc& arc : step.contact.arcs) {
    const double cosine = 1 - b * MM / arc.radius;
    EXPECT_NEAR(degFromRad(arc.entry), 0.0, ANGLE);
    if (std::abs(cosine) > 0.9) continue;  // both surfaces are nearly parallel there
    EXPECT_NEAR(degFromRad(arc.exit), degFromRad(std::acos(cosine)), ANGLE) << arc.radius / MM;
    ++checked;
  }
  EXPECT_GE(checked, 5);
  EXPECT_NEAR(step.contact.side_area / (MM * MM * b * (depth - b * b / (24 * R))), 1.0, 2 * VOLUME);
  EXPECT_NEAR(cut.volume() / cut.columnVolume(), 1.0, CURVED_VOLUME);
}

TEST(ToolShapes, SlotsOfABullNoseAndOfAFaceMill) {
  const double depth = 3.0;
  const Cut bull(formatted("G0 X-10 Y20.03 Z-%g\nG1 X70\n", depth), withEdge(1.0));
  const Step& step = bull.at(3, 30);
  ASSERT_EQ(step.contact.arcs.size(), 1u);
  EXPECT_NEAR(step.contact.axialDepth() / MM, depth, 1e-3);
  EXPECT_NEAR(bull.volume() / (60 * (2 * R * depth - 2 + 0.5 * PI)), 1.0, VOLUME);
  const Cut face(formatted("G0 X-20 Y20.03 Z-%g\nG1 X80\n", depth), withEdge(0.0, 45.0));
  EXPECT_NEAR(face.volume() / (60 * (2 * R * depth + depth * depth)), 1.0, VOLUME);
}

TEST(ToolShapes, PlungeOfABallRemovesACap) {
  const Cut cut("G0 X30 Y20 Z1\nG1 Z-2\n", withEdge(R), BLOCK, 0.05);
  EXPECT_NEAR(cut.volume() / (PI * 4 * (3 * R - 2) / 3), 1.0, CURVED_VOLUME);
  EXPECT_NEAR(cut.columnVolume() / (PI * 4 * (3 * R - 2) / 3), 1.0, VOLUME);
}

// What the contact removes is what the columns lose, on ramps, helices and over earlier cuts.
TEST(ToolShapes, VolumesOfRandomPathsAreThoseOfTheColumns) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> x(8, 52), y(8, 32), z(-3, -0.5);
  for (const ToolProfile& profile : {withEdge(R), withEdge(1.5), withEdge(0.5, 60.0)}) {
    std::string text = "G0 X30 Y20 Z1\n";
    for (int k = 0; k < 12; ++k) text += formatted("G1 X%.3f Y%.3f Z%.3f\n", x(random), y(random), z(random));
    text += "G3 X30 Y20 Z-2 R25\n";
    const Cut cut(text, profile);
    EXPECT_NEAR(cut.volume() / cut.columnVolume(), 1.0, CURVED_VOLUME);
  }
}

TEST(ToolShapes, AHigherPassOfTheSamePathIsAir) {
  const Cut cut("G0 X-10 Y20 Z-1\nG1 X70 Z-3\nX-10 Z-1\n", withEdge(R));
  EXPECT_LT(cut.volume(4), 1e-3 * cut.volume(3));
}

TEST(StockShapes, ACylinderIsCutWhereTheToolMeetsIt) {
  const double stock = 15.0, depth = 2.0;
  const Cut cut(formatted("G0 X-30 Y0 Z-%g\nG1 X30\n", depth), ToolProfile(R * MM),
                StockShape::cylinder({0, 0}, stock * MM, -10 * MM, 0));
  for (const double x : {-16.3, -14.2, -12.0}) {
    // The circles of tool and stock meet at the angle of the law of cosines.
    const Step& step = cut.at(3, x);
    const double d = -step.tip[0] / MM, half = std::acos((d * d + R * R - stock * stock) / (2 * d * R));
    ASSERT_EQ(step.contact.arcs.size(), 1u) << x;
    EXPECT_NEAR(degFromRad(step.contact.entry()), std::max(0.0, 90 - degFromRad(half)), ANGLE) << x;
    EXPECT_NEAR(degFromRad(step.contact.exit()), std::min(180.0, 90 + degFromRad(half)), ANGLE) << x;
  }
  const double strip = 2 * (stock * stock * std::asin(R / stock) + R * std::sqrt(stock * stock - R * R));
  EXPECT_NEAR(cut.volume() / (strip * depth), 1.0, 2 * VOLUME);
}

/// Facets of a roof over a rectangle: eaves at z = -4, ridge at z = 0 along x, lower face at z = -10 [mm].
std::string roof() {
  const double a[8][3] = {{0, 0, -10}, {60, 0, -10}, {60, 40, -10}, {0, 40, -10},
                          {0, 0, -4},  {60, 0, -4},  {60, 40, -4},  {0, 40, -4}};
  const double ridge[2][3] = {{0, 20, 0}, {60, 20, 0}};
  std::string text = "solid roof\n";
  const auto facet = [&](const double* p, const double* q, const double* r) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const double* v : {p, q, r}) text += formatted("vertex %g %g %g\n", v[0], v[1], v[2]);
    text += "endloop\nendfacet\n";
  };
  const auto quad = [&](const double* p, const double* q, const double* r, const double* s) {
    facet(p, q, r);
    facet(p, r, s);
  };
  quad(a[0], a[3], a[2], a[1]);
  quad(a[0], a[1], a[5], a[4]);
  quad(a[2], a[3], a[7], a[6]);
  quad(a[4], a[5], ridge[1], ridge[0]);
  quad(a[6], a[7], ridge[0], ridge[1]);
  quad(a[3], a[0], a[4], a[7]);
  facet(a[4], ridge[0], a[7]);
  quad(a[1], a[2], a[6], a[5]);
  facet(a[6], ridge[1], a[5]);
  return text + "endsolid\n";
}

TEST(StockShapes, AnStlFileIsTheMaterialBelowItsSurface) {
  const TemporaryFolder folder;
  const std::string file = folder.write("roof.stl", roof());
  const StockShape shape = StockShape::mesh(std::make_shared<TriangleMesh>(readStl(file, MM)));
  EXPECT_NEAR(shape.top(30 * MM, 20 * MM) / MM, 0.0, 1e-9);
  EXPECT_NEAR(shape.top(10 * MM, 5 * MM) / MM, -3.0, 1e-9);
  EXPECT_TRUE(std::isinf(shape.top(61 * MM, 20 * MM)));
  // A slot along the ridge: a roof of the tool's width.
  const double depth = 2.0, half = std::min(R, 20 * depth / 4);
  const Cut cut(formatted("G0 X-10 Y20 Z-%g\nG1 X70\n", depth), ToolProfile(R * MM), shape);
  EXPECT_NEAR(cut.volume() / (60 * (2 * half * depth - half * half / 5)), 1.0, 2 * VOLUME);
}

TEST(StockShapes, StlFilesThatCannotBeUsedAreRefusedInOneLine) {
  const TemporaryFolder folder;
  const std::string file = folder.write("part.stl", "");
  const auto error = [&](const std::string& text) {
    std::ofstream(file, std::ios::binary) << text;
    return errorOf([&] { readStl(file, MM); });
  };
  std::string open = roof();
  open.erase(open.find("facet normal"), open.find("endfacet\n") + 9 - open.find("facet normal"));
  EXPECT_EQ(error(open), file +
                             ": the surface has holes: 3 edges without a neighbour, one of them at X0 Y0 "
                             "Z-10; expected a closed surface");
  EXPECT_EQ(error("nothing"), file +
                                  ": 7 bytes, expected an STL file: \"solid\" with facets as text, or 84 "
                                  "bytes and 50 for each facet");
  EXPECT_EQ(error("solid a\nfacet normal 0 0 1\nvertex 1 2\nendfacet\n"),
            file + ": facet 1: a vertex without three numbers");
  EXPECT_EQ(error("solid a\nfacet normal 0 0 1\nvertex\n"),
            file + ": facet 1: a vertex without three numbers");
}

TEST(Holder, MeetsAWallThatIsHigherThanTheStickout) {
  for (const bool reaches : {false, true}) {
    ToolShape tool{ToolProfile(R * MM)};
    tool.holder_radius = 12 * MM;
    tool.holder_height = (reaches ? 5.9 : 6.1) * MM;
    Stock stock(BLOCK, 0.1 * MM);
    CutSimulation simulation(stock, [&](int) -> const ToolShape& { return tool; });
    bool hit = false;
    for (const Move& move :
         interpretProgram("G21 G90 G17 S3000 M3 F600\nG0 X-10 Y20 Z-6\nG1 X70\nM30\n", "part.nc"))
      simulation.run(move, [&](const Step& step) {
        hit = hit || step.holder_hit;
        return true;
      });
    EXPECT_EQ(hit, reaches);
  }
}

}  // namespace
}  // namespace smartmill::program
