#include "smartmill_program/stock/stock.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace smartmill::program {
namespace {

constexpr std::size_t TILE = 32;  // [columns] side of a tile: a third of a usual tool's radius at 0.1 mm
constexpr double SAME_HEIGHT =
    1e-6;  // [m] a surface between columns that differ by less is level; last digit of a program
/// [columns] around a point: material that ends in a corner of 20 degrees or more between the columns next to
/// the point is found by one of these.
constexpr std::size_t BORDER = 3;

}  // namespace

Stock::Stock(const StockShape& shape, double resolution)
    : shape_(shape),
      grid_(shape, resolution),
      tiles_x_((grid_.columns(0) + TILE - 1) / TILE),
      tiles_y_((grid_.columns(1) + TILE - 1) / TILE),
      tiles_(tiles_x_ * tiles_y_) {
}

void Stock::begin(const Sweep& sweep) {
  if (!sweeps_.empty()) advance(sweeps_.back().length());
  sweeps_.push_back(sweep);
  done_ = 0.0;
  const StockBlock& block = grid_.block();
  if (sweep.lowest() >= block.high[2]) return;
  const std::array<double, 4> box =
      sweep.path().isArc()
          ? std::array<double, 4>{sweep.path().centre()[0] - sweep.path().radius() - sweep.radius(),
                                  sweep.path().centre()[0] + sweep.path().radius() + sweep.radius(),
                                  sweep.path().centre()[1] - sweep.path().radius() - sweep.radius(),
                                  sweep.path().centre()[1] + sweep.path().radius() + sweep.radius()}
          : sweep.box(0.0, sweep.length());
  if (box[1] < block.low[0] || box[0] > block.high[0] || box[3] < block.low[1] || box[2] > block.high[1])
    return;
  for (std::size_t j = grid_.indexOf(1, box[2]) / TILE; j <= grid_.indexOf(1, box[3]) / TILE; ++j)
    for (std::size_t i = grid_.indexOf(0, box[0]) / TILE; i <= grid_.indexOf(0, box[1]) / TILE; ++i)
      addTo(i, j);
}

void Stock::addTo(std::size_t tile_i, std::size_t tile_j) {
  const double wide = TILE * grid_.width(0), deep = TILE * grid_.width(1);
  const double x = grid_.block().low[0] + (static_cast<double>(tile_i) + 0.5) * wide;
  const double y = grid_.block().low[1] + (static_cast<double>(tile_j) + 0.5) * deep;
  if (!sweeps_.back().mayReach(x, y, 0.5 * std::hypot(wide, deep))) return;
  Tile& tile = tiles_[tile_j * tiles_x_ + tile_i];
  if (tile.sweeps.size() >= tile.prune_at) prune(tile, tile_i, tile_j);
  tile.sweeps.push_back(
      {static_cast<std::uint32_t>(sweeps_.size() - 1), static_cast<float>(sweeps_.back().lowest())});
}

void Stock::prune(Tile& tile, std::size_t tile_i, std::size_t tile_j) {
  // With the border of columns with which a point is compared.
  const auto range = [&](std::size_t axis, std::size_t index) {
    const std::size_t first = index * TILE;
    return std::array<std::size_t, 2>{first > 0 ? first - 1 : 0,
                                      std::min(first + TILE, grid_.columns(axis) - 1)};
  };
  const double top = grid_.highest(range(0, tile_i), range(1, tile_j)) + SAME_HEIGHT;
  tile.sweeps.erase(std::remove_if(tile.sweeps.begin(), tile.sweeps.end(),
                                   [&](const Entry& entry) { return entry.lowest > top; }),
                    tile.sweeps.end());
  tile.prune_at = std::max<std::size_t>(32, 2 * tile.sweeps.size());
}

void Stock::advance(double distance) {
  if (distance <= done_ && done_ > 0.0) return;
  grid_.remove(sweeps_.back(), done_, distance);
  done_ = distance;
}

double Stock::height(double x, double y) const {
  const StockBlock& block = grid_.block();
  if (x < block.low[0] || x > block.high[0] || y < block.low[1] || y > block.high[1]) return EMPTY;
  const std::array<double, 2> around = grid_.heightsAround(x, y, BORDER);
  double lowest = around[1];
  if (around[1] - around[0] > SAME_HEIGHT) {
    if (const std::optional<double> smooth = grid_.smoothHeight(x, y, BORDER)) return *smooth;
    lowest = std::min(lowest, shape_.top(x, y));
    // The last sweeps are the most probable ones; none is expected below the lowest column.
    const std::vector<Entry>& entries =
        tiles_[grid_.indexOf(1, y) / TILE * tiles_x_ + grid_.indexOf(0, x) / TILE].sweeps;
    for (auto entry = entries.rbegin(); entry != entries.rend() && lowest > around[0] + SAME_HEIGHT;
         ++entry) {
      if (entry->lowest >= lowest) continue;
      const Sweep& sweep = sweeps_[entry->sweep];
      const double end = entry->sweep + 1 == sweeps_.size() ? done_ : sweep.length();
      lowest = std::min(lowest, sweep.lowestSurface(x, y, 0.0, end, lowest));
    }
  }
  return lowest <= block.low[2] ? EMPTY : lowest;
}

double Stock::faceVolume(double x, double y, double radius, double top, double bottom) const {
  const StockBlock& block = grid_.block();
  const double cell = std::max(grid_.width(0), grid_.width(1)), reach = radius + cell;
  if (x + reach < block.low[0] || x - reach > block.high[0] || y + reach < block.low[1] ||
      y - reach > block.high[1])
    return 0.0;
  const double floor = std::max(bottom, block.low[2]);
  double sum = 0.0;
  bool touches = false;  // a column of which the middle is below the tool; those across its circumference
                         // stay as they are
  for (std::size_t j = grid_.indexOf(1, y - reach); j <= grid_.indexOf(1, y + reach); ++j) {
    for (std::size_t i = grid_.indexOf(0, x - reach); i <= grid_.indexOf(0, x + reach); ++i) {
      const double removed = std::min(top, grid_.height(i, j)) - floor;
      if (removed <= 0.0) continue;
      // Share of the column within the circle, by the distance of its middle from the circumference.
      const double inside = radius - std::hypot(grid_.middle(0, i) - x, grid_.middle(1, j) - y);
      touches = touches || (inside > 0.0 && removed > SAME_HEIGHT);
      sum += removed * std::clamp(0.5 + inside / cell, 0.0, 1.0);
    }
  }
  return touches ? sum * grid_.width(0) * grid_.width(1) : 0.0;
}

bool Stock::reaches(double x, double y, double radius, double z) const {
  const StockBlock& block = grid_.block();
  if (z >= block.high[2] || x + radius < block.low[0] || x - radius > block.high[0] ||
      y + radius < block.low[1] || y - radius > block.high[1])
    return false;
  for (std::size_t j = grid_.indexOf(1, y - radius); j <= grid_.indexOf(1, y + radius); ++j)
    for (std::size_t i = grid_.indexOf(0, x - radius); i <= grid_.indexOf(0, x + radius); ++i)
      if (grid_.height(i, j) > z + SAME_HEIGHT &&
          std::hypot(grid_.middle(0, i) - x, grid_.middle(1, j) - y) < radius)
        return true;
  return false;
}

}  // namespace smartmill::program
