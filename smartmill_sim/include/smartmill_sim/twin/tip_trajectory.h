#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::sim {

/// Displacement and rate of the tip in x and y.
struct TipMotion {
  std::array<double, 2> displacement{{0, 0}};  ///< [m]
  std::array<double, 2> rate{{0, 0}};          ///< [m/s]
};

/// Motion of the tool tip in a recorded cut: from tool_x and tool_y or, without them, from fx and fy through
/// the inverse of the force sensor's FRF and the receptance of the tool tip.
class TipTrajectory {
 public:
  /// Whether the record has the channels.
  static bool isAvailable(const Record& recorded);
  /// Whether it follows from the forces.
  static bool isFromForce(const Record& recorded);

  /// @param model as changed by its effects @param sample_rate [Hz]
  TipTrajectory(const MachineModel& model, const Record& recorded, double sample_rate,
                const SimulationOptions& options = {});

  /// Interpolated between sample i (share 0) and the next one (share 1).
  TipMotion at(std::size_t i, double share) const;

 private:
  double sample_rate_;                      // [Hz]
  std::array<std::vector<double>, 2> tip_;  // [m]
};

/// Cubic (Catmull-Rom) interpolation between sample i (share 0) and the next one (share 1); constant beyond
/// the ends.
double interpolated(const std::vector<double>& samples, std::size_t i, double share);

}  // namespace smartmill::sim
