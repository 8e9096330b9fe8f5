#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace smartmill::program {

/// A closed surface of triangles, and the highest point of it over the plane.
class TriangleMesh {
 public:
  using Point = std::array<double, 3>;
  struct Triangle {
    std::array<Point, 3> corners;  ///< [m]
  };

  /// @throws Error without triangles
  explicit TriangleMesh(std::vector<Triangle> triangles);

  const Point& low() const { return low_; }    ///< [m]
  const Point& high() const { return high_; }  ///< [m]
  /// [m] z; minus infinity outside of the surface.
  double top(double x, double y) const;

 private:
  std::size_t cellOf(std::size_t axis, double coordinate) const;

  std::vector<Triangle> triangles_;
  Point low_{}, high_{};
  // Triangles by the cells of a square grid that they reach.
  std::size_t cells_ = 1;  // along each axis
  std::vector<std::vector<std::size_t>> in_cell_;
};

/// Reads an STL file, text or binary. @param unit [m] of its coordinates
/// @throws Error naming the file: not an STL file, no facets, a surface with holes
TriangleMesh readStl(const std::string& file, double unit);

}  // namespace smartmill::program
