#include "smartmill_core/cutting/corner.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using units::PI;

const ToolGeometry TOOL{2, 20e-3, units::radFromDeg(30.0), {}};

TEST(Corner, slicesSumToTheEdge) {
  for (const double corner : {0.5e-3, 4e-3, 10e-3}) {
    double length = 0.0, across = 0.0, height = 0.0;
    const std::vector<EdgeSlice> slices = edgeSlices(TOOL, corner);
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
  for (const EdgeSlice& slice : edgeSlices(TOOL, 5e-3)) {
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
  const EdgeSlice slice = edgeSlices(TOOL, 4e-3)[3];
  const double middle = 0.5 * (slice.low + slice.high);
  const EdgeSlice below = upTo(middle, slice, 4e-3);
  EXPECT_NEAR(below.low, slice.low, 1e-15);
  EXPECT_NEAR(below.high, middle, 1e-15);
  const EdgeSlice whole = upTo(slice.high, slice, 4e-3);
  EXPECT_NEAR(whole.length, slice.length, 1e-12);
  EXPECT_NEAR(whole.inset, slice.inset, 1e-15);
}

TEST(Corner, rejectsARadiusAboveTheTools) {
  EXPECT_NO_THROW(edgeSlices(TOOL, 10e-3));
  EXPECT_THROW(edgeSlices(TOOL, 10.1e-3), Error);
  EXPECT_THROW(edgeSlices(TOOL, -1e-3), Error);
}

}  // namespace
}  // namespace smartmill
