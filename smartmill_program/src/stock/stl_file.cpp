#include <cstdint>
#include <cstring>
#include <map>
#include <sstream>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_program/stock/triangle_mesh.h"

namespace smartmill::program {
namespace {

constexpr std::size_t HEADER = 84, FACET = 50;  // [bytes] of a binary file

using Triangle = TriangleMesh::Triangle;
using Point = TriangleMesh::Point;

/// Binary: 80 bytes, the number of facets, 12 floats and 2 bytes each; little-endian, as the processors for
/// which this is built.
std::vector<Triangle> binaryFacets(const std::string& file, const std::string& bytes) {
  std::uint32_t count = 0;
  if (bytes.size() >= HEADER) std::memcpy(&count, bytes.data() + HEADER - sizeof count, sizeof count);
  if (bytes.size() < HEADER || bytes.size() != HEADER + FACET * static_cast<std::size_t>(count))
    throw Error(formatted(
        "%s: %zu bytes, expected an STL file: \"solid\" with facets as text, or %zu bytes and %zu for "
        "each facet",
        file.c_str(), bytes.size(), HEADER, FACET));
  std::vector<Triangle> triangles(count);
  for (std::size_t k = 0; k < count; ++k) {
    std::array<float, 12> values{};  // normal and corners
    std::memcpy(values.data(), bytes.data() + HEADER + FACET * k, sizeof values);
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t a = 0; a < 3; ++a)
        triangles[k].corners[c][a] = static_cast<double>(values[3 + 3 * c + a]);
  }
  return triangles;
}

std::vector<Triangle> textFacets(const std::string& file, const std::string& text) {
  std::istringstream words(text);
  std::vector<Triangle> triangles;
  std::string word;
  std::size_t corner = 0;
  Triangle triangle{};
  while (words >> word) {
    if (word == "facet") corner = 0;
    if (word != "vertex") continue;
    Point& point = triangle.corners.at(corner % 3);
    if (!(words >> point[0] >> point[1] >> point[2]))
      throw Error(
          formatted("%s: facet %zu: a vertex without three numbers", file.c_str(), triangles.size() + 1));
    if (++corner == 3) triangles.push_back(triangle);
    if (corner > 3)
      throw Error(formatted("%s: facet %zu: more than three vertices", file.c_str(), triangles.size()));
  }
  return triangles;
}

/// @throws Error unless each edge of a triangle belongs to a second one that runs along it the other way
void requireClosed(const std::string& file, const std::vector<Triangle>& triangles) {
  std::map<std::pair<Point, Point>, int> open;  // number of edges without their opposite
  for (const Triangle& triangle : triangles) {
    for (std::size_t c = 0; c < 3; ++c) {
      const Point &from = triangle.corners[c], &to = triangle.corners[(c + 1) % 3];
      const auto opposite = open.find({to, from});
      if (opposite == open.end()) {
        ++open[{from, to}];
      } else if (--opposite->second == 0) {
        open.erase(opposite);
      }
    }
  }
  if (open.empty()) return;
  const Point& at = open.begin()->first.first;
  throw Error(formatted(
      "%s: the surface has holes: %zu edges without a neighbour, one of them at X%g Y%g Z%g; expected a "
      "closed surface",
      file.c_str(), open.size(), at[0], at[1], at[2]));
}

}  // namespace

TriangleMesh readStl(const std::string& file, double unit) {
  const std::string bytes = readText(file);
  const bool text = bytes.rfind("solid", 0) == 0 && bytes.find("facet") != std::string::npos &&
                    bytes.find("vertex") != std::string::npos;
  std::vector<Triangle> triangles = text ? textFacets(file, bytes) : binaryFacets(file, bytes);
  if (triangles.empty()) throw Error(file + ": no facets, expected a closed surface");
  requireClosed(file, triangles);
  for (Triangle& triangle : triangles)
    for (Point& corner : triangle.corners)
      for (double& coordinate : corner) coordinate *= unit;
  return TriangleMesh(std::move(triangles));
}

}  // namespace smartmill::program
