#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "smartmill_program/stock/stock_shape.h"
#include "smartmill_program/stock/sweep.h"

namespace smartmill::program {

/// Columns of material (z-dexels, z-buffer; van Hook 1986) on a square grid in x and y. Each has the height
/// of the material at its middle, so that a stock without undercuts is described in full up to the width of a
/// column. Where there is no material it is that of the bottom.
class DexelGrid {
 public:
  /// @param resolution [m] largest width of a column. @throws Error on an empty stock and on too many columns
  DexelGrid(const StockShape& shape, double resolution);

  const StockBlock& block() const { return block_; }
  std::size_t columns(std::size_t axis) const { return count_[axis]; }  ///< along x (0) or y (1)
  double width(std::size_t axis) const { return width_[axis]; }         ///< [m] of a column
  double middle(std::size_t axis, std::size_t index) const {            ///< [m] of a column
    return block_.low[axis] + (static_cast<double>(index) + 0.5) * width_[axis];
  }
  double height(std::size_t i, std::size_t j) const { return height_[j * count_[0] + i]; }  ///< [m] z
  /// Column that contains a coordinate [m], limited to the block.
  std::size_t indexOf(std::size_t axis, double coordinate) const;
  /// [m] Least and largest height of the columns around a point of the block: the four whose middles surround
  /// it and `border` more on each side.
  std::array<double, 2> heightsAround(double x, double y, std::size_t border = 0) const;
  /// [m] Interpolated height at a point, where the curvature of the surface hardly changes between the
  /// columns of heightsAround(); nullopt at walls, steps, edges and the border of the block. @param border >=
  /// 1
  std::optional<double> smoothHeight(double x, double y, std::size_t border) const;
  /// [m] Largest height in a range of columns: {first, last} along x, along y, inclusive.
  double highest(const std::array<std::size_t, 2>& x, const std::array<std::size_t, 2>& y) const;

  /// Removes the material of a sweep between two distances [m] along its path.
  void remove(const Sweep& sweep, double from, double to);
  double volume() const;  ///< [m3] of the material

 private:
  // First and last column along an axis with its middle within a range; false: none.
  bool columnsIn(std::size_t axis, double low, double high, std::array<long, 2>& range) const;
  void removeInRow(const Sweep& sweep, double from, double to, std::size_t j, double low, double high);

  StockBlock block_;
  std::array<std::size_t, 2> count_{{0, 0}};
  std::array<double, 2> width_{{0, 0}};
  std::vector<float> height_;  // relative error 6e-8
};

}  // namespace smartmill::program
