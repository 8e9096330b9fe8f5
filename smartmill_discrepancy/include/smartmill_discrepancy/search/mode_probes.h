#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/gap/twin_runner.h"

namespace smartmill::discrepancy {

/// What a mode of one frequency would add to the simulated channels, to first order, for a quick look over
/// many frequencies.
class ModeProbes {
 public:
  /// @param model what the search stands at. @param samples that are looked at, in rising order. @param
  /// runner must outlive this
  ModeProbes(const TwinRunner& runner, const MachineModel& model, std::vector<Eigen::Index> samples);

  /// One more mode of the force sensor along an axis (0..2), per unit of gain: a column a frequency [Hz], a
  /// row each of the samples.
  Eigen::MatrixXd sensorModes(std::size_t axis, const std::vector<double>& frequencies,
                              double damping_ratio) const;

  /// A mode of the tool tip along x or y (0, 1), per m/N: regeneration to first order in the compliance. A
  /// column a frequency [Hz].
  Eigen::MatrixXd tipModes(std::size_t axis, const std::vector<double>& frequencies,
                           double damping_ratio) const;

  /// Frequencies [Hz] to look at, evenly spread on a logarithmic scale.
  static std::vector<double> grid(double low, double high, double ratio);

 private:
  struct Displaced;
  Displaced displaced(std::size_t first, std::size_t end, std::size_t axis,
                      const std::vector<double>& frequencies, double damping_ratio) const;
  void addRegeneration(std::size_t first, std::size_t end, std::size_t axis, const Displaced& tip,
                       Eigen::MatrixXd* columns) const;

  /// Calls put(sample of the block, row of the columns) for each of the samples in a block.
  template <class Put>
  void forEachIn(const Block& block, const Put& put) const;

  const TwinRunner& runner_;
  MachineModel model_;
  std::vector<Eigen::Index> samples_;
  // Force per m of outward motion of the tool along x and y over a turn: rows fx fy fz, columns x y [N/m].
  using Stiffness = std::array<std::array<double, 2>, 3>;
  static std::vector<Stiffness> cuttingStiffness(const MachineModel& model, const Engagement& engagement);
  std::map<std::size_t, std::vector<Stiffness>> stiffness_;  // of the runner's cuts
  std::vector<double> applied_;  // force on the sensor over noise, laid out as the runner's vectors
};

}  // namespace smartmill::discrepancy
