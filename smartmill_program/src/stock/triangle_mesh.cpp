#include "smartmill_program/stock/triangle_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::program {
namespace {

constexpr std::size_t MOST_CELLS = 500;  // along an axis
/// [1] of the area of a triangle, by which a point on its edge counts as inside despite rounding.
constexpr double EDGE = 1e-9;

double cross(const TriangleMesh::Point& a, const TriangleMesh::Point& b, double x, double y) {
  return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
}

}  // namespace

TriangleMesh::TriangleMesh(std::vector<Triangle> triangles) : triangles_(std::move(triangles)) {
  if (triangles_.empty()) throw Error("mesh: no triangles, expected a closed surface");
  low_ = high_ = triangles_.front().corners[0];
  for (const Triangle& triangle : triangles_) {
    for (const Point& corner : triangle.corners) {
      for (std::size_t a = 0; a < 3; ++a) {
        low_[a] = std::min(low_[a], corner[a]);
        high_[a] = std::max(high_[a], corner[a]);
      }
    }
  }
  const auto count = static_cast<double>(triangles_.size());
  cells_ = std::clamp<std::size_t>(static_cast<std::size_t>(std::sqrt(count)), 1, MOST_CELLS);
  in_cell_.resize(cells_ * cells_);
  for (std::size_t k = 0; k < triangles_.size(); ++k) {
    const std::array<Point, 3>& corners = triangles_[k].corners;
    const Point &a = corners[0], &b = corners[1], &c = corners[2];
    if (cross(a, b, c[0], c[1]) == 0.0) continue;  // vertical
    const auto range = [&](std::size_t axis) {
      return std::array<std::size_t, 2>{cellOf(axis, std::min({a[axis], b[axis], c[axis]})),
                                        cellOf(axis, std::max({a[axis], b[axis], c[axis]}))};
    };
    const std::array<std::size_t, 2> x = range(0), y = range(1);
    for (std::size_t j = y[0]; j <= y[1]; ++j)
      for (std::size_t i = x[0]; i <= x[1]; ++i) in_cell_[j * cells_ + i].push_back(k);
  }
}

std::size_t TriangleMesh::cellOf(std::size_t axis, double coordinate) const {
  const double share = (coordinate - low_[axis]) / std::max(high_[axis] - low_[axis], 1e-12);
  return static_cast<std::size_t>(
      std::clamp(share * static_cast<double>(cells_), 0.0, static_cast<double>(cells_ - 1)));
}

double TriangleMesh::top(double x, double y) const {
  double top = -std::numeric_limits<double>::infinity();
  if (x < low_[0] || x > high_[0] || y < low_[1] || y > high_[1]) return top;
  for (const std::size_t k : in_cell_[cellOf(1, y) * cells_ + cellOf(0, x)]) {
    const auto& [a, b, c] = triangles_[k].corners;
    // Barycentric coordinates.
    const double area = cross(a, b, c[0], c[1]);
    const double u = cross(b, c, x, y) / area, v = cross(c, a, x, y) / area, w = 1.0 - u - v;
    if (std::min({u, v, w}) >= -EDGE) top = std::max(top, u * a[2] + v * b[2] + w * c[2]);
  }
  return top;
}

}  // namespace smartmill::program
