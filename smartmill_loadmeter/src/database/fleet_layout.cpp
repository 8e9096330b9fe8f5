#include "fleet_layout.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

namespace {

constexpr double LEAST_STD = 1e-9;  // [1] smallest standard deviation of a cell, to divide by

}  // namespace

FleetLayout::FleetLayout(const std::vector<FleetObservation>& all, const FleetModelOptions& options)
    : observations(all), unstated_std(options.unstated_std) {
  indexObservations();
  if (options.known) {
    noise = options.known->noise;
  } else {
    estimateNoise();
  }
  fillCells();
}

std::optional<std::size_t> FleetLayout::materialAt(const std::string& name) const {
  const auto at = std::find(materials.begin(), materials.end(), name);
  if (at == materials.end()) return std::nullopt;
  return static_cast<std::size_t>(at - materials.begin());
}

const MachineCells* FleetLayout::machineAt(const std::string& name) const {
  const auto at =
      std::find_if(machines.begin(), machines.end(), [&](const MachineCells& m) { return m.name == name; });
  return at == machines.end() ? nullptr : &*at;
}

double FleetLayout::statedVariance(const FleetObservation& o) const {
  const double relative = std::isfinite(o.std_dev) ? o.std_dev / o.value : unstated_std;
  return relative * relative;
}

double FleetLayout::varianceOf(const FleetObservation& o) const {
  return std::max(statedVariance(o) + noise * noise, LEAST_STD * LEAST_STD);
}

void FleetLayout::indexObservations() {
  for (const FleetObservation& o : observations) {
    if (!(o.value > 0.0) || !std::isfinite(o.value))
      throw Error("fleet: value of '" + o.machine + "' in '" + o.material +
                  "': expected a finite number > 0");
    auto material = materialAt(o.material);
    if (!material) {
      materials.push_back(o.material);
      material = materials.size() - 1;
    }
    std::size_t g = 0;
    while (g < groups.size() && (groups[g].material != *material || groups[g].tool != o.tool)) ++g;
    if (g == groups.size()) groups.push_back({o.tool, *material});
    std::size_t m = 0;
    while (m < machines.size() && machines[m].name != o.machine) ++m;
    if (m == machines.size()) machines.push_back({o.machine, {}, {}});
    machines[m].observations.push_back(group_of.size());
    group_of.push_back(g);
    machine_of.push_back(m);
  }
  if (observations.empty()) throw Error("fleet: no observations");
}

// Scatter within cells beyond the stated deviations, by the method of moments: E sum (y - mean)^2 = sum (1 -
// 1/n) (s^2 + noise^2).
void FleetLayout::estimateNoise() {
  std::map<std::pair<std::size_t, std::size_t>, std::vector<std::size_t>> cells;
  for (std::size_t i = 0; i < observations.size(); ++i) cells[{machine_of[i], group_of[i]}].push_back(i);
  double scatter = 0.0, stated = 0.0, freedom = 0.0;
  for (const auto& [key, members] : cells) {
    const double n = static_cast<double>(members.size());
    double mean = 0.0;
    for (const std::size_t i : members) mean += std::log(observations[i].value) / n;
    for (const std::size_t i : members) {
      scatter += std::pow(std::log(observations[i].value) - mean, 2);
      stated += (1.0 - 1.0 / n) * statedVariance(observations[i]);
    }
    freedom += n - 1.0;
  }
  if (freedom > 0.0) noise = std::sqrt(std::max(0.0, (scatter - stated) / freedom));
}

void FleetLayout::fillCells() {
  for (MachineCells& machine : machines) {
    for (const std::size_t i : machine.observations) {
      auto cell = std::find_if(machine.cells.begin(), machine.cells.end(),
                               [&](const FleetCell& c) { return c.group == group_of[i]; });
      if (cell == machine.cells.end())
        cell = machine.cells.insert(machine.cells.end(), FleetCell{group_of[i]});
      const double variance = varianceOf(observations[i]);
      // At first sums of weights and of weighted values.
      ++cell->count;
      cell->variance += 1.0 / variance;
      cell->mean += std::log(observations[i].value) / variance;
    }
    for (FleetCell& cell : machine.cells) {
      cell.mean /= cell.variance;
      cell.variance = 1.0 / cell.variance;
    }
  }
}

}  // namespace smartmill::loadmeter
