#include "fleet_posterior.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace smartmill::loadmeter {

namespace {

constexpr std::array<double FleetDeviations::*, 3> AXES{&FleetDeviations::machine, &FleetDeviations::batch,
                                                        &FleetDeviations::tool};
using Axes = std::array<std::vector<double>, 3>;

std::vector<FleetPoint> evaluate(const FleetSolver& solver, const FleetDeviations& prior, const Axes& axes) {
  std::vector<FleetPoint> points;
  for (const double machine : axes[0]) {
    for (const double batch : axes[1]) {
      for (const double tool : axes[2]) {
        points.push_back(solver.solve({machine, batch, tool, solver.layout().noise}));
        // The axes are logarithmic.
        points.back().log_weight += std::log(machine * batch * tool) -
                                    0.5 * (std::pow(machine / prior.machine, 2) +
                                           std::pow(batch / prior.batch, 2) + std::pow(tool / prior.tool, 2));
      }
    }
  }
  double top = -std::numeric_limits<double>::infinity(), sum = 0.0;
  for (const FleetPoint& point : points) top = std::max(top, point.log_weight);
  for (FleetPoint& point : points) sum += point.log_weight = std::exp(point.log_weight - top);
  for (FleetPoint& point : points) point.log_weight /= sum;
  return points;
}

}  // namespace

// Integrates over a wide grid, then over one about its mean.
std::vector<FleetPoint> posteriorOf(const FleetSolver& solver, const FleetModelOptions& options) {
  if (options.known) {
    std::vector<FleetPoint> points{solver.solve(*options.known)};
    points[0].log_weight = 1.0;
    return points;
  }
  const FleetModelOptions::Grid& grid = options.grid;
  Axes axes;
  for (std::size_t a = 0; a < 3; ++a) {
    const double low = grid.low.*AXES[a], high = grid.high.*AXES[a];
    for (int i = 0; i < grid.coarse; ++i)
      axes[a].push_back(low * std::pow(high / low, i / (grid.coarse - 1.0)));
  }
  std::vector<FleetPoint> points = evaluate(solver, options.prior, axes);
  for (std::size_t a = 0; a < 3; ++a) {
    double mean = 0.0, square = 0.0;
    for (const FleetPoint& point : points) {
      const double x = std::log(point.s.*AXES[a]);
      mean += point.log_weight * x;
      square += point.log_weight * x * x;
    }
    const double step = std::log(grid.high.*AXES[a] / grid.low.*AXES[a]) / (grid.coarse - 1.0);
    const double spread = std::max(0.5 * step, std::sqrt(std::max(0.0, square - mean * mean)));
    axes[a].clear();
    for (int i = 0; i < grid.fine; ++i)
      axes[a].push_back(std::exp(mean + spread * (2.0 * grid.spread * i / (grid.fine - 1.0) - grid.spread)));
  }
  points = evaluate(solver, options.prior, axes);
  points.erase(std::remove_if(points.begin(), points.end(),
                              [&](const FleetPoint& p) { return p.log_weight < grid.smallest_weight; }),
               points.end());
  return points;
}

}  // namespace smartmill::loadmeter
