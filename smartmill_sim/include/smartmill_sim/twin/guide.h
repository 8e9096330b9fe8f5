#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

/// Where a tip is and how it moves, x and y.
struct TipPlace {
  std::array<double, 2> displacement{{0, 0}};  ///< [m]
  std::array<double, 2> rate{{0, 0}};          ///< [m/s]
};

/// Where the tip of a tool was in a recorded cut: as tool_x and tool_y show it or, without them, where the
/// forces that fx and fy show push it by this model: through the force sensor's inverse to the forces on the
/// tool, through the tool's modes to its place.
class Guide {
 public:
  /// Whether a record shows enough.
  static bool canBe(const Record& recorded);
  /// The same, and by its forces only.
  static bool byForce(const Record& recorded);

  /// @param model as the effects left it @param sample_rate [Hz]
  Guide(const MachineModel& model, const Record& recorded, double sample_rate);

  /// At a share 0..1 of the way from sample i to the next.
  TipPlace at(std::size_t i, double share) const;

 private:
  double sample_rate_;                      // [Hz]
  std::array<std::vector<double>, 2> tip_;  // [m]
};

/// Smooth, exact at the samples, the last ones held beyond the ends.
double interpolated(const std::vector<double>& samples, std::size_t i, double share);

}  // namespace smartmill::sim
