#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/twin_runner.h"

namespace smartmill::discrepancy {

/// What a mode of one frequency would add to the simulated channels, to first order, for a quick look over
/// many frequencies.
class ModeProbes {
 public:
  /// @param model what the search stands at. @param runner must outlive this
  ModeProbes(const TwinRunner& runner, const MachineModel& model);

  /// One more mode of the force sensor along an axis (0..2), per unit of gain.
  std::vector<double> sensorMode(std::size_t axis, double frequency, double damping_ratio) const;

  /// A mode of the tool tip along x or y (0, 1), per m/N: regeneration to first order in the compliance.
  std::vector<double> tipMode(std::size_t axis, double frequency, double damping_ratio) const;

  /// Frequencies [Hz] to look at, evenly spread on a logarithmic scale.
  static std::vector<double> grid(double low, double high, double ratio);

 private:
  const TwinRunner& runner_;
  MachineModel model_;
  std::vector<double> applied_;  // force on the sensor over noise, laid out as the runner's vectors
};

}  // namespace smartmill::discrepancy
