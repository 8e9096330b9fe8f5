#include "smartmill_core/nc/path_segment.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::nc {
namespace {

using units::PI;

void expectPoint(const PathSegment::Point& point, const PathSegment::Point& expected) {
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(point[i], expected[i], 1e-12) << i;
}

TEST(PathSegment, Line) {
  const PathSegment path = PathSegment::line({1, 2, 3}, {1, 5, 7});
  EXPECT_NEAR(path.length(), 5.0, 1e-12);
  EXPECT_FALSE(path.isArc());
  expectPoint(path.at(2.5), {1, 3.5, 5});
  expectPoint(path.at(9.0), {1, 5, 7});
  expectPoint(path.direction(1.0), {0, 0.6, 0.8});
  expectPoint(path.upTo(2.5).target(), {1, 3.5, 5});
}

// A quarter of a circle about the origin of each plane, counterclockwise from the first to the second axis,
// and the other three.
TEST(PathSegment, ArcsInAllPlanes) {
  for (const Plane plane : {Plane::xy, Plane::zx, Plane::yz}) {
    const auto [a, b, c] = axesOf(plane);
    PathSegment::Point start{}, target{}, middle{};
    start[a] = 2.0;
    target[b] = 2.0;
    target[c] = 1.0;  // helix
    middle[a] = middle[b] = std::sqrt(2.0);
    middle[c] = 0.5;
    const PathSegment quarter = PathSegment::arc(start, target, {0, 0}, false, plane);
    EXPECT_NEAR(quarter.length(), std::hypot(PI, 1.0), 1e-12);
    expectPoint(quarter.at(0.5 * quarter.length()), middle);
    const PathSegment rest = PathSegment::arc(start, target, {0, 0}, true, plane);
    EXPECT_NEAR(rest.sweep(), -1.5 * PI, 1e-12);
    middle[a] = middle[b] = -std::sqrt(2.0);
    expectPoint(rest.at(0.5 * rest.length()), middle);
    // The direction is the derivative.
    const PathSegment::Point before = quarter.at(1.0 - 1e-6), after = quarter.at(1.0 + 1e-6);
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_NEAR(quarter.direction(1.0)[i], (after[i] - before[i]) / 2e-6, 1e-9);
  }
}

TEST(PathSegment, FullCircleAndItsPart) {
  const PathSegment circle = PathSegment::arc({1, 0, 0}, {1, 0, 0}, {0, 0}, true);
  EXPECT_NEAR(circle.length(), 2 * PI, 1e-12);
  const PathSegment half = circle.upTo(PI);
  expectPoint(half.target(), {-1, 0, 0});
  EXPECT_NEAR(half.sweep(), -PI, 1e-12);
  expectPoint(half.at(0.5 * PI), {0, -1, 0});
}

}  // namespace
}  // namespace smartmill::nc
