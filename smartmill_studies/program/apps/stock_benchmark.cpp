// Removal of material on one core: the columns of smartmill_program next to a level set of OpenVDB with
// voxels of the same width, of which the tool at each step is subtracted. Both execute the same steps of 0.3
// mm of a pocket with a tool of 10 mm; removed_mm3 is their result.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <benchmark/benchmark.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Composite.h>
#include <openvdb/tools/LevelSetMeasure.h>
#include <openvdb/tools/LevelSetPlatonic.h>
#include <openvdb/tools/SignedFloodFill.h>

#include "program/ring_pocket.h"
#include "smartmill_core/units.h"
#include "smartmill_program/nc/program_reader.h"
#include "smartmill_program/stock/stock.h"

namespace {

using namespace smartmill;
using namespace smartmill::program;
using units::MM;

constexpr double RADIUS = 5 * MM, STEP = 0.3 * MM;
constexpr std::array<double, 3> LOW{0, 0, -20 * MM}, HIGH{120 * MM, 80 * MM, 0};
constexpr double HALF_WIDTH = 3.0;  // [voxels] of the level set's band

std::vector<Move> feedMoves() {
  std::vector<Move> moves;
  for (const Move& move : interpretProgram(ringPocket(), "pocket"))
    if (!move.rapid && move.path.length() > 0.0) moves.push_back(move);
  return moves;
}

/// Steps of the path until `most` are done. @param begin(path), step(path, from, to)
template <class Begin, class Step>
int execute(const std::vector<Move>& moves, int most, const Begin& begin, const Step& step) {
  int done = 0;
  for (const Move& move : moves) {
    begin(move.path);
    const int count = static_cast<int>(std::ceil(move.path.length() / STEP));
    for (int k = 0; k < count; ++k, ++done) {
      if (done == most) return done;
      step(move.path, move.path.length() * k / count, move.path.length() * (k + 1) / count);
    }
  }
  return done;
}

void report(benchmark::State& state, int steps, double removed) {
  state.counters["steps"] = steps;
  state.counters["removed_mm3"] = removed / std::pow(MM, 3);
  state.counters["steps_per_second"] =
      benchmark::Counter(static_cast<double>(steps), benchmark::Counter::kIsIterationInvariantRate);
}

// Arguments: width of a column [um], number of steps.
void columns(benchmark::State& state) {
  const std::vector<Move> moves = feedMoves();
  const ToolProfile profile(RADIUS);
  int steps = 0;
  double removed = 0.0;
  for (auto _ : state) {
    Stock stock(StockBlock{LOW, HIGH}, static_cast<double>(state.range(0)) * units::UM);
    const double before = stock.columns().volume();
    steps = execute(
        moves, static_cast<int>(state.range(1)),
        [&](const nc::PathSegment& path) { stock.begin(Sweep(path, profile)); },
        [&](const nc::PathSegment&, double, double to) { stock.advance(to); });
    removed = before - stock.columns().volume();
  }
  report(state, steps, removed);
}

using Grid = openvdb::FloatGrid;
using Point = nc::PathSegment::Point;

/// Level set of the tool between two places, upwards to above the stock.
Grid::Ptr toolBetween(const Point& a, const Point& b, const openvdb::math::Transform& transform,
                      double voxel) {
  const auto band = static_cast<float>(HALF_WIDTH * voxel);
  Grid::Ptr tool = openvdb::createLevelSet<Grid>(voxel, HALF_WIDTH);
  tool->setTransform(transform.copy());
  const double tip = std::min(a[2], b[2]), top = HIGH[2] + 2.0 * HALF_WIDTH * voxel;
  const double border = RADIUS + (HALF_WIDTH + 1.0) * voxel;
  const openvdb::Coord low = openvdb::Coord::floor(transform.worldToIndex(openvdb::Vec3d(
      std::min(a[0], b[0]) - border, std::min(a[1], b[1]) - border, tip - HALF_WIDTH * voxel)));
  const openvdb::Coord high = openvdb::Coord::ceil(transform.worldToIndex(openvdb::Vec3d(
      std::max(a[0], b[0]) + border, std::max(a[1], b[1]) + border, top + HALF_WIDTH * voxel)));
  auto access = tool->getAccessor();
  const double dx = b[0] - a[0], dy = b[1] - a[1], square = dx * dx + dy * dy;
  for (int i = low.x(); i <= high.x(); ++i) {
    for (int j = low.y(); j <= high.y(); ++j) {
      const openvdb::Vec3d at = transform.indexToWorld(openvdb::Coord(i, j, 0));
      const double x = at[0] - a[0], y = at[1] - a[1];
      const double share = square > 0.0 ? std::clamp((x * dx + y * dy) / square, 0.0, 1.0) : 0.0;
      const double side = std::hypot(x - share * dx, y - share * dy) - RADIUS;
      if (side > band) continue;
      for (int k = low.z(); k <= high.z(); ++k) {
        const double z = transform.indexToWorld(openvdb::Coord(i, j, k))[2];
        const auto distance = static_cast<float>(std::max({side, tip - z, z - top}));
        if (std::abs(distance) < band) access.setValueOn({i, j, k}, distance);
      }
    }
  }
  openvdb::tools::signedFloodFill(tool->tree());
  return tool;
}

// Arguments: width of a voxel [um], number of steps.
void levelSet(benchmark::State& state) {
  openvdb::initialize();
  const std::vector<Move> moves = feedMoves();
  const double voxel = static_cast<double>(state.range(0)) * units::UM;
  const auto transform = openvdb::math::Transform::createLinearTransform(voxel);
  int steps = 0;
  double removed = 0.0;
  for (auto _ : state) {
    Grid::Ptr stock = openvdb::tools::createLevelSetBox<Grid>(
        openvdb::math::BBox<openvdb::Vec3s>(openvdb::Vec3s(LOW.data()), openvdb::Vec3s(HIGH.data())),
        *transform, static_cast<float>(HALF_WIDTH));
    const double before = openvdb::tools::levelSetVolume(*stock);
    steps = execute(
        moves, static_cast<int>(state.range(1)), [](const nc::PathSegment&) {},
        [&](const nc::PathSegment& path, double from, double to) {
          openvdb::tools::csgDifference(*stock, *toolBetween(path.at(from), path.at(to), *transform, voxel));
        });
    removed = before - openvdb::tools::levelSetVolume(*stock);
  }
  report(state, steps, removed);
}

BENCHMARK(columns)
    ->ArgNames({"column_um", "most_steps"})
    ->Args({200, 2000})
    ->Args({100, 2000})
    ->Args({100, 1000000})
    ->Unit(benchmark::kMillisecond);
BENCHMARK(levelSet)
    ->ArgNames({"voxel_um", "most_steps"})
    ->Args({200, 2000})
    ->Args({100, 2000})
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
