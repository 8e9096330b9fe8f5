#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::plant {

struct Point {
  double x = 0.0, y = 0.0;  ///< [m] of the workpiece, x along the feed
};

/// Workpiece surface ahead of a slice of the tool: a polygon in workpiece coordinates, from which the tooth
/// tips remove material. Chip thickness is the distance between a tip and the polygon along the ray from the
/// tool axis; it needs no feed per tooth, earlier teeth or rules for them.
///
/// The polygon is star-shaped about the tool axis, with its corners in the order of clockwise rotation.
class Front {
 public:
  /// A round front of this radius about the origin. @param teeth of the tool @param step [rad] between
  /// corners
  Front(double radius, std::size_t teeth, double step);

  /// Advances the tip of a tooth by less than half a revolution and removes the material it passes. @param
  /// axis current position of the tool axis @return chip thickness [m] along the ray from axis to tip; not
  /// positive where the tip is in air
  double pass(std::size_t tooth, const Point& axis, const Point& tip);

  std::size_t corners() const { return size_; }

 private:
  static constexpr std::size_t END = static_cast<std::size_t>(-1);
  struct Corner {
    Point at;
    std::size_t before = END, after = END;
  };
  /// Position of a tooth: the corner before it, its last tip and depth.
  struct Tooth {
    std::size_t behind = END;  ///< END: not ahead of the first corner yet
    Point tip;
    double depth = 0.0;  ///< [m]
    bool moving = false;
  };

  /// Removes the material between the last and the present tip of a tooth. @param begin corner before the
  /// last tip @param next first corner after the present tip @param depth [m] of the tip
  void clip(Tooth& tooth, std::size_t begin, std::size_t next, const Point& tip, double depth);
  std::size_t insertAfter(std::size_t corner, const Point& at);
  void remove(std::size_t corner);
  void forget(const Point& axis);

  std::vector<Corner> pool_;
  std::vector<std::size_t> free_;
  std::vector<Tooth> teeth_;
  std::size_t first_ = END, last_ = END, size_ = 0;
  double radius_;
};

}  // namespace smartmill::plant
