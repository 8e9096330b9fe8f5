#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/fleet_model.h"

namespace smartmill::loadmeter {

/// Observations of one group by one machine.
struct FleetCell {
  std::size_t group = 0;
  int count = 0;
  double mean = 0.0, variance = 0.0;  // of the logarithm, weighted
};

struct MachineCells {
  std::string name;
  std::vector<FleetCell> cells;
  std::vector<std::size_t> observations;
};

/// Tool in a material.
struct FleetGroup {
  std::string tool;
  std::size_t material = 0;
};

/// Observations of a fleet by group and machine, and their noise.
struct FleetLayout {
  std::vector<FleetObservation> observations;
  std::vector<std::string> materials;
  std::vector<FleetGroup> groups;
  std::vector<MachineCells> machines;
  std::vector<std::size_t> group_of, machine_of;  // of each observation
  double unstated_std;                            // [1], FleetModelOptions
  double noise = 0.0;                             // [1] of the logarithm, beyond the stated deviations

  /// @throws Error without observations or with one that is not positive.
  FleetLayout(const std::vector<FleetObservation>& all, const FleetModelOptions& options);

  std::optional<std::size_t> materialAt(const std::string& name) const;
  const MachineCells* machineAt(const std::string& name) const;
  double statedVariance(const FleetObservation& o) const;  ///< [1] of the logarithm
  double varianceOf(const FleetObservation& o) const;      ///< [1] with the noise

 private:
  void indexObservations();
  void estimateNoise();
  void fillCells();
};

}  // namespace smartmill::loadmeter
