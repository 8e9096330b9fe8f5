#include "smartmill_core/cutting/corner.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using units::PI;

const ToolGeometry TOOL{2, 20e-3, units::radFromDeg(30.0), {}};

ToolGeometry withCorner(double corner_radius, double edge_angle_deg = 90.0) {
  ToolGeometry tool = TOOL;
  tool.edge.corner_radius = corner_radius;
  if (edge_angle_deg < 90.0) tool.edge.edge_angle = units::radFromDeg(edge_angle_deg);
  return tool;
}

TEST(Corner, slicesSumToTheEdge) {
  for (const double corner : {0.5e-3, 4e-3, 10e-3}) {
    double length = 0.0, across = 0.0, height = 0.0;
    const std::vector<EdgeSlice> slices = edgeSlices(withCorner(corner), 0.0);
    for (const EdgeSlice& slice : slices) {
      EXPECT_DOUBLE_EQ(slice.low, height);
      if (&slice == &slices.back()) break;
      const double rise = slice.high - slice.low;
      height = slice.high;
      length += slice.length * rise;
      across += slice.length * slice.edge_axial * rise;
    }
    EXPECT_NEAR(height, corner, 1e-15);
    EXPECT_NEAR(length, 0.5 * PI * corner, 1e-15);
    EXPECT_NEAR(across, corner, 1e-15);  // up to the vertical edge
  }
}

TEST(Corner, aVerticalEdgeIsAStraightMill) {
  const std::vector<EdgeSlice> slices = edgeSlices(TOOL, 0.0);
  ASSERT_EQ(slices.size(), 1u);
  CuttingLaw law;
  law.coefficients = {800e6, 200e6, 100e6, 20e3, 10e3, 5e3};
  law.size_exponent = 0.2;
  law.edge_chip = 1e-5;
  const CuttingLaw same = lawOf(slices[0], law);
  EXPECT_DOUBLE_EQ(same.coefficients.ktc, 800e6);
  EXPECT_DOUBLE_EQ(same.coefficients.krc, 200e6);
  EXPECT_DOUBLE_EQ(same.coefficients.kac, 100e6);
  EXPECT_DOUBLE_EQ(same.coefficients.kte, 20e3);
  EXPECT_DOUBLE_EQ(same.coefficients.kre, 10e3);
  EXPECT_DOUBLE_EQ(same.coefficients.kae, 5e3);
  EXPECT_DOUBLE_EQ(same.edge_chip, 1e-5);
  EXPECT_DOUBLE_EQ(toolOf(slices[0], TOOL).diameter, TOOL.diameter);
  EXPECT_NEAR(toolOf(slices[0], TOOL).helix, TOOL.helix, 1e-15);
}

// Near the tip Fr of an edge is axial; it pushes the tool out of the work.
TEST(Corner, theNormalRotatesFromAxialToRadial) {
  CuttingLaw law;
  law.coefficients = {0.0, 200e6, 0.0, 0.0, 10e3, 0.0};
  law.damping = 1.0;
  double last = 1e9;
  for (const EdgeSlice& slice : edgeSlices(withCorner(5e-3), 0.0)) {
    const CuttingLaw leaning = lawOf(slice, law);
    const double lean = std::atan2(leaning.coefficients.kac, leaning.coefficients.krc);
    const double edge_lean = std::atan2(leaning.coefficients.kae, leaning.coefficients.kre);
    EXPECT_LT(lean, last);
    EXPECT_GE(lean, 0.0);
    EXPECT_NEAR(lean, edge_lean, 0.05);
    EXPECT_NEAR(std::atan2(leaning.damping_axial, leaning.damping_radial), lean, 1e-12);
    last = lean;
  }
  EXPECT_EQ(last, 0.0);
}

TEST(Corner, aSliceIsTruncatedExactly) {
  const EdgeSlice slice = edgeSlices(withCorner(4e-3), 0.0)[3];
  const double middle = 0.5 * (slice.low + slice.high);
  const EdgeSlice below = between(slice.low, middle, slice, withCorner(4e-3));
  EXPECT_NEAR(below.low, slice.low, 1e-15);
  EXPECT_NEAR(below.high, middle, 1e-15);
  const EdgeSlice whole = between(slice.low, slice.high, slice, withCorner(4e-3));
  EXPECT_NEAR(whole.length, slice.length, 1e-12);
  EXPECT_NEAR(whole.inset, slice.inset, 1e-15);
}

TEST(Corner, rejectsARadiusAboveTheTools) {
  EXPECT_NO_THROW(edgeSlices(withCorner(10e-3), 0.0));
  EXPECT_THROW(edgeSlices(withCorner(10.1e-3), 0.0), Error);
  EXPECT_THROW(edgeSlices(withCorner(-1e-3), 0.0), Error);
}

// An arc between the face and an inclined edge: slices join at its ends (law of tangents: the edge extended
// to the face has the radius of the tool).
TEST(Corner, theArcMeetsAnInclinedEdge) {
  const double corner = 2e-3, angle = units::radFromDeg(45.0), depth = 4e-3;
  const ToolGeometry tool = withCorner(corner, 45.0);
  EXPECT_NEAR(cornerHeight(tool), corner * (1.0 - std::cos(angle)), 1e-15);
  double length = 0.0;
  for (const EdgeSlice& slice : edgeSlices(tool, depth, 2000)) {
    const double top = std::min(slice.high, depth);
    if (top <= slice.low) break;
    length += slice.length * (top - slice.low);
    // The middle of a thin slice lies on the arc about the point (R - r tan(angle / 2), r), or on the edge.
    const double radius = tool.radius() - slice.inset, z = slice.middle();
    if (slice.curved) {
      const double off = radius - (tool.radius() - corner * std::tan(0.5 * angle));
      EXPECT_NEAR(std::hypot(off, z - corner), corner, 2e-6);
    } else {
      EXPECT_NEAR(radius, tool.radius() + z, 1e-12);
      EXPECT_NEAR(slice.chip_radial, std::sin(angle), 1e-15);
      EXPECT_NEAR(slice.chip_axial, std::cos(angle), 1e-15);
    }
  }
  EXPECT_NEAR(length, corner * angle + (depth - cornerHeight(tool)) / std::sin(angle), 1e-12);
}

TEST(Corner, thePitchOfAVariableHelixChangesWithHeight) {
  ToolGeometry tool = TOOL;
  tool.setHelix({units::radFromDeg(30.0), units::radFromDeg(40.0)});
  const double change = (std::tan(units::radFromDeg(40.0)) - std::tan(units::radFromDeg(30.0))) / 10e-3;
  EXPECT_NEAR(tool.pitchAt(0, 3e-3), PI - change * 3e-3, 1e-12);
  EXPECT_NEAR(tool.pitchAt(1, 3e-3), PI + change * 3e-3, 1e-12);
  EXPECT_NEAR(tool.lag(), 0.5 * (tool.lagOf(0) + tool.lagOf(1)), 1e-9);
  for (const EdgeSlice& slice : edgeSlices(tool, 5e-3)) {
    const ToolGeometry mill = toolOf(slice, tool);
    ASSERT_EQ(mill.pitch.size(), 2u);
    EXPECT_NEAR(mill.pitch[0], PI - change * slice.middle(), 1e-12);
    // In its middle tooth 1 of the slice's mill is where the edge is.
    EXPECT_NEAR(slice.turn + mill.lag() * (slice.middle() - slice.low), tool.lagOf(0) * slice.middle(),
                1e-12);
    EXPECT_TRUE(mill.edge.straight());
  }
  EXPECT_THROW(tool.pitchAt(0, PI / change * 1.01), Error);
  EXPECT_NO_THROW(tool.pitchAt(0, PI / change * 0.99));
}

TEST(Corner, serrationsAreShiftedFromToothToTooth) {
  ToolGeometry tool = TOOL;
  tool.edge.serration_amplitude = 0.2e-3;
  tool.edge.serration_wavelength = 2e-3;
  for (const EdgeSlice& slice : edgeSlices(tool, 3e-3)) {
    const std::vector<double> radii = radiiOf(slice, tool, {1e-6, 2e-6});
    EXPECT_NEAR(radii[0], 1e-6 + 0.2e-3 * std::sin(2.0 * PI * slice.middle() / 2e-3), 1e-15);
    EXPECT_NEAR(radii[1], 2e-6 - 0.2e-3 * std::sin(2.0 * PI * slice.middle() / 2e-3), 1e-15);
  }
  EXPECT_THROW(requireStraightEdge(tool, "to test"), Error);
  EXPECT_NO_THROW(requireStraightEdge(TOOL, "to test"));
}

TEST(Corner, rejectsShapesThatCannotBe) {
  ToolGeometry flat = TOOL;
  flat.edge.edge_angle = 0.0;
  EXPECT_THROW(edgeSlices(flat, 0.0), Error);
  ToolGeometry overhung = TOOL;
  overhung.edge.edge_angle = 1.7;
  EXPECT_THROW(edgeSlices(overhung, 0.0), Error);
  ToolGeometry few = TOOL;
  few.edge.helix = {0.5};
  EXPECT_THROW(edgeSlices(few, 0.0), Error);
  ToolGeometry wave = TOOL;
  wave.edge.serration_amplitude = 1e-4;
  EXPECT_THROW(edgeSlices(wave, 0.0), Error);
}

}  // namespace
}  // namespace smartmill
