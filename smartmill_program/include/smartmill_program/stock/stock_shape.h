#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

namespace smartmill::program {

/// A block of material with edges along the axes.
struct StockBlock {
  std::array<double, 3> low{{0, 0, 0}}, high{{0, 0, 0}};  ///< [m]
};

class TriangleMesh;

/// The material before the first cut: a block, a vertical cylinder, or a closed surface of triangles. Below
/// its upper surface the stock counts as solid.
class StockShape {
 public:
  StockShape(const StockBlock& block) : bounds_(block) {}  // NOLINT(google-explicit-constructor)
  /// @param centre [m] x, y @param radius [m] > 0 @param low, high [m] z
  static StockShape cylinder(const std::array<double, 2>& centre, double radius, double low, double high);
  static StockShape mesh(std::shared_ptr<const TriangleMesh> mesh);

  const StockBlock& bounds() const { return bounds_; }
  bool isBlock() const { return radius_ == 0.0 && !mesh_; }
  /// [m] z of the upper surface at a point; minus infinity outside of the stock.
  double top(double x, double y) const;

 private:
  StockBlock bounds_;
  std::array<double, 2> centre_{{0, 0}};  // [m]
  double radius_ = 0.0;                   // [m] 0: no cylinder
  std::shared_ptr<const TriangleMesh> mesh_;
};

}  // namespace smartmill::program
