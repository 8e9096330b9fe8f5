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

/// First-order response of the simulated channels to one more mode, for a scan over many frequencies.
class ModeProbes {
 public:
  /// @param runner must outlive this object @param model at the current state @param samples to evaluate,
  /// ascending
  ModeProbes(const TwinRunner& runner, const MachineModel& model, std::vector<Eigen::Index> samples);

  /// One more mode of the force sensor along an axis (0..2), per unit of gain: one column per frequency [Hz],
  /// one row per sample.
  Eigen::MatrixXd sensorModes(std::size_t axis, const std::vector<double>& frequencies,
                              double damping_ratio) const;

  /// A mode of the tool tip along x or y (0, 1), per m/N: regeneration to first order in the compliance; one
  /// column per frequency [Hz].
  Eigen::MatrixXd tipModes(std::size_t axis, const std::vector<double>& frequencies,
                           double damping_ratio) const;

 private:
  struct TipDisplacement;
  TipDisplacement tipDisplacement(std::size_t first, std::size_t end, std::size_t axis,
                                  const std::vector<double>& frequencies, double damping_ratio) const;
  void addRegeneration(std::size_t first, std::size_t end, std::size_t axis, const TipDisplacement& tip,
                       Eigen::MatrixXd* columns) const;

  /// Calls function(sample of the span, row of the columns) for each of the samples in a span.
  template <class Function>
  void forEachSampleIn(const ChannelSpan& block, const Function& function) const;

  const TwinRunner& runner_;
  MachineModel model_;
  std::vector<Eigen::Index> samples_;
  // Force per m of outward motion of the tool along x and y over a revolution: rows fx fy fz, columns x y
  // [N/m].
  using Stiffness = std::array<std::array<double, 2>, 3>;
  std::vector<Stiffness> cuttingStiffness(const CampaignTest& test) const;
  std::map<std::size_t, std::vector<Stiffness>> stiffness_;  // by cut of the runner
  std::vector<double> applied_;  // force on the sensor over noise, in the layout of the runner's vectors
};

}  // namespace smartmill::discrepancy
