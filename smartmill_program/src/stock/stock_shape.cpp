#include "smartmill_program/stock/stock_shape.h"

#include <cmath>
#include <limits>
#include <utility>

#include "smartmill_core/require.h"
#include "smartmill_program/stock/triangle_mesh.h"

namespace smartmill::program {

StockShape StockShape::cylinder(const std::array<double, 2>& centre, double radius, double low, double high) {
  require("radius of the stock [m]", radius, Range::positive());
  StockShape shape(
      {{centre[0] - radius, centre[1] - radius, low}, {centre[0] + radius, centre[1] + radius, high}});
  shape.centre_ = centre;
  shape.radius_ = radius;
  return shape;
}

StockShape StockShape::mesh(std::shared_ptr<const TriangleMesh> mesh) {
  StockShape shape({mesh->low(), mesh->high()});
  shape.mesh_ = std::move(mesh);
  return shape;
}

double StockShape::top(double x, double y) const {
  constexpr double NONE = -std::numeric_limits<double>::infinity();
  if (mesh_) return mesh_->top(x, y);
  if (radius_ > 0.0) return std::hypot(x - centre_[0], y - centre_[1]) <= radius_ ? bounds_.high[2] : NONE;
  const bool inside =
      x >= bounds_.low[0] && x <= bounds_.high[0] && y >= bounds_.low[1] && y <= bounds_.high[1];
  return inside ? bounds_.high[2] : NONE;
}

}  // namespace smartmill::program
