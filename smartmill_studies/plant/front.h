#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::plant {

struct Point {
  double x = 0.0, y = 0.0;  ///< [m] of the workpiece, x along the feed
};

/// Surface of the work ahead of a slice of the tool: a polygon in the coordinates of the work, from which the
/// teeth's tips cut pieces. Chip thickness is what stands between a tip and the polygon along the ray from
/// the tool's axis; nothing here knows of feed per tooth, earlier teeth or rules for them.
///
/// The polygon is star-shaped about the tool's axis, in the order in which a clockwise tool passes its
/// corners.
class Front {
 public:
  /// A round front of this radius about the origin. @param teeth of the tool @param step [rad] between
  /// corners
  Front(double radius, std::size_t teeth, double step);

  /// Moves a tooth's tip on, which turns by less than half a turn from call to call, and removes what it
  /// passed. @param axis of the tool now @return chip thickness [m] along the ray from axis to tip; not
  /// positive where the tip runs free
  double pass(std::size_t tooth, const Point& axis, const Point& tip);

  std::size_t corners() const { return size_; }

 private:
  static constexpr std::size_t END = static_cast<std::size_t>(-1);
  struct Corner {
    Point at;
    std::size_t before = END, after = END;
  };
  /// Where a tooth stands: behind this corner, its last tip and how deep it was.
  struct Tooth {
    std::size_t behind = END;  ///< END: not ahead of the first corner yet
    Point tip;
    double depth = 0.0;  ///< [m]
    bool moving = false;
  };

  /// Takes away what a tooth cut on its way to its tip here. @param begin corner behind which it stood
  /// @param next corner that it has not reached @param depth [m] of the tip
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
