#include "smartmill_program/stock/dexel_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

constexpr double MOST_COLUMNS = 2e8;  // 0.8 GB
/// [m] Third difference between columns of a smooth surface: the error of a height between them is at most a
/// quarter of it.
constexpr float MOST_BEND = 1e-6F;
constexpr std::array<const char*, 3> AXES{"X", "Y", "Z"};

}  // namespace

DexelGrid::DexelGrid(const StockShape& shape, double resolution) : block_(shape.bounds()) {
  const StockBlock& block = block_;
  require("resolution [m]", resolution, Range::positive());
  for (std::size_t i = 0; i < 3; ++i) {
    if (!(block.high[i] > block.low[i]))
      throw Error(formatted("stock: size %g mm in %s, expected a value above 0",
                            (block.high[i] - block.low[i]) / units::MM, AXES[i]));
  }
  double total = 1.0;
  for (std::size_t i = 0; i < 2; ++i) {
    // A block of whole columns has exactly as many, despite rounding.
    const double count = std::ceil((block.high[i] - block.low[i]) / resolution - 1e-6);
    total *= count;
    if (total > MOST_COLUMNS)
      throw Error(formatted("resolution %g mm: more than %g columns in the stock, expected a coarser one",
                            resolution / units::MM, MOST_COLUMNS));
    count_[i] = static_cast<std::size_t>(count);
    width_[i] = (block.high[i] - block.low[i]) / count;
  }
  height_.assign(count_[0] * count_[1], static_cast<float>(block.high[2]));
  if (shape.isBlock()) return;
  for (std::size_t j = 0; j < count_[1]; ++j)
    for (std::size_t i = 0; i < count_[0]; ++i)
      height_[j * count_[0] + i] =
          static_cast<float>(std::max(block.low[2], shape.top(middle(0, i), middle(1, j))));
}

std::size_t DexelGrid::indexOf(std::size_t axis, double coordinate) const {
  const double index = std::floor((coordinate - block_.low[axis]) / width_[axis]);
  return static_cast<std::size_t>(std::clamp(index, 0.0, static_cast<double>(count_[axis] - 1)));
}

std::array<double, 2> DexelGrid::heightsAround(double x, double y, std::size_t border) const {
  const std::size_t left = indexOf(0, x - 0.5 * width_[0]), below = indexOf(1, y - 0.5 * width_[1]);
  const std::size_t first_i = left > border ? left - border : 0,
                    first_j = below > border ? below - border : 0;
  const std::size_t last_i = std::min(left + 1 + border, count_[0] - 1);
  const std::size_t last_j = std::min(below + 1 + border, count_[1] - 1);
  float low = height_[first_j * count_[0] + first_i], high = low;
  for (std::size_t j = first_j; j <= last_j; ++j) {
    const float* row = height_.data() + j * count_[0];
    for (std::size_t i = first_i; i <= last_i; ++i) {
      low = std::min(low, row[i]);
      high = std::max(high, row[i]);
    }
  }
  return {low, high};
}

std::optional<double> DexelGrid::smoothHeight(double x, double y, std::size_t border) const {
  const double u = (x - block_.low[0]) / width_[0] - 0.5, v = (y - block_.low[1]) / width_[1] - 0.5;
  if (!(u >= static_cast<double>(border) && v >= static_cast<double>(border))) return std::nullopt;
  const auto i = static_cast<std::size_t>(u), j = static_cast<std::size_t>(v);
  const std::size_t first_i = i - border, last_i = i + 1 + border, first_j = j - border,
                    last_j = j + 1 + border;
  if (last_i >= count_[0] || last_j >= count_[1]) return std::nullopt;
  const auto bent = [this](std::size_t column, std::size_t stride) {
    const float* z = height_.data() + column;
    return std::abs(z[3 * stride] - z[0] - 3.0F * (z[2 * stride] - z[stride])) > MOST_BEND;
  };
  for (std::size_t b = first_j; b <= last_j; ++b)
    for (std::size_t a = first_i; a + 3 <= last_i; ++a)
      if (bent(b * count_[0] + a, 1)) return std::nullopt;
  for (std::size_t b = first_j; b + 3 <= last_j; ++b)
    for (std::size_t a = first_i; a <= last_i; ++a)
      if (bent(b * count_[0] + a, count_[0])) return std::nullopt;
  // Catmull-Rom: exact for a paraboloid.
  const auto weights = [](double t) {
    return std::array<double, 4>{0.5 * t * (-1.0 + t * (2.0 - t)), 1.0 + 0.5 * t * t * (3.0 * t - 5.0),
                                 0.5 * t * (1.0 + t * (4.0 - 3.0 * t)), 0.5 * t * t * (t - 1.0)};
  };
  const std::array<double, 4> across = weights(u - static_cast<double>(i)),
                              along = weights(v - static_cast<double>(j));
  double z = 0.0;
  for (std::size_t b = 0; b < 4; ++b)
    for (std::size_t a = 0; a < 4; ++a) z += along[b] * across[a] * height(i + a - 1, j + b - 1);
  return z > block_.low[2] ? std::optional<double>(z) : std::nullopt;
}

double DexelGrid::highest(const std::array<std::size_t, 2>& x, const std::array<std::size_t, 2>& y) const {
  float most = -std::numeric_limits<float>::infinity();
  for (std::size_t j = y[0]; j <= y[1]; ++j)
    for (std::size_t i = x[0]; i <= x[1]; ++i) most = std::max(most, height_[j * count_[0] + i]);
  return most;
}

bool DexelGrid::columnsIn(std::size_t axis, double low, double high, std::array<long, 2>& range) const {
  const double last = static_cast<double>(count_[axis]) - 1.0;
  const double first = std::max(0.0, std::ceil((low - block_.low[axis]) / width_[axis] - 0.5));
  const double end = std::min(last, std::floor((high - block_.low[axis]) / width_[axis] - 0.5));
  range = {static_cast<long>(first), static_cast<long>(end)};
  return first <= end;
}

void DexelGrid::removeInRow(const Sweep& sweep, double from, double to, std::size_t j, double low,
                            double high) {
  std::array<long, 2> range{};
  if (!columnsIn(0, low, high, range)) return;
  float* row = height_.data() + j * count_[0];
  const bool uniform = sweep.slope() == 0.0 && !sweep.path().isArc() && sweep.profile().flat();
  const auto level = static_cast<float>(sweep.z(from));
  const double y = middle(1, j);
  for (long i = range[0]; i <= range[1]; ++i) {
    const double x = middle(0, static_cast<std::size_t>(i));
    const float z =
        uniform ? level
                : static_cast<float>(sweep.lowestSurface(x, y, from, to, static_cast<double>(row[i])));
    row[i] = std::min(row[i], z);
  }
}

void DexelGrid::remove(const Sweep& sweep, double from, double to) {
  if (std::min(sweep.z(from), sweep.z(to)) >= block_.high[2]) return;
  const std::array<double, 4> box = sweep.box(from, to);
  std::array<long, 2> rows{};
  if (!columnsIn(1, box[2], box[3], rows)) return;
  // The disc at `from` has been removed already by a flat end, unless the tool descends from there.
  const bool skip = from > 0.0 && sweep.slope() >= 0.0 && sweep.profile().flat();
  const nc::PathSegment::Point start = sweep.path().at(from);
  for (long row = rows[0]; row <= rows[1]; ++row) {
    const auto j = static_cast<std::size_t>(row);
    const double y = middle(1, j);
    std::array<double, 2> range{};
    if (!sweep.rowRange(y, from, to, range)) continue;
    const double inner = sweep.radius() * sweep.radius() - (y - start[1]) * (y - start[1]);
    if (skip && inner > 0.0) {
      const double half = std::sqrt(inner) - Sweep::SKIN;
      removeInRow(sweep, from, to, j, range[0], start[0] - half);
      removeInRow(sweep, from, to, j, start[0] + half, range[1]);
    } else {
      removeInRow(sweep, from, to, j, range[0], range[1]);
    }
  }
}

double DexelGrid::volume() const {
  double sum = 0.0;
  for (const float z : height_) sum += std::max(0.0, z - block_.low[2]);
  return sum * width_[0] * width_[1];
}

}  // namespace smartmill::program
