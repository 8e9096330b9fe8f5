#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "smartmill_program/stock/dexel_grid.h"
#include "smartmill_program/stock/sweep.h"

namespace smartmill::program {

/// Material with the memory of what has cut it: columns for the height in the interior of surfaces, and the
/// sweeps themselves and the shape of the stock for walls, where neighbouring columns differ. A wall is
/// therefore exact and not rounded to a column; only what is narrower than a column is lost. On smooth
/// surfaces the height is interpolated.
class Stock {
 public:
  static constexpr double EMPTY = -std::numeric_limits<double>::infinity();

  /// @param resolution [m] width of a column. @throws Error as DexelGrid
  Stock(const StockShape& shape, double resolution);

  const DexelGrid& columns() const { return grid_; }
  const StockBlock& block() const { return grid_.block(); }

  /// Begins a sweep; advance() removes its material.
  void begin(const Sweep& sweep);
  /// Removes the material of the present sweep up to a distance [m] along its path, not less than before.
  void advance(double distance);
  const Sweep& sweep() const { return sweeps_.back(); }
  double done() const { return done_; }  ///< [m] along the present sweep

  /// [m] Height of the material at a point; EMPTY outside of the stock and where the tool has cut through it.
  double height(double x, double y) const;
  /// Whether a column within a radius [m] of a point is higher than `z` [m].
  bool reaches(double x, double y, double radius, double z) const;
  /// [m3] Material that the end face removes when the tip descends between two heights [m] at a place, from
  /// the columns.
  double faceVolume(double x, double y, double radius, double top, double bottom) const;

 private:
  struct Entry {
    std::uint32_t sweep;  // index
    float lowest;         // [m] of its tip
  };
  struct Tile {
    std::vector<Entry> sweeps;  // that may reach it, in the order of time
    std::size_t prune_at = 32;  // number of sweeps at which those above the material are dropped
  };
  void addTo(std::size_t tile_i, std::size_t tile_j);
  void prune(Tile& tile, std::size_t tile_i, std::size_t tile_j);

  StockShape shape_;
  DexelGrid grid_;
  std::vector<Sweep> sweeps_;
  double done_ = 0.0;
  std::size_t tiles_x_, tiles_y_;
  std::vector<Tile> tiles_;
};

}  // namespace smartmill::program
