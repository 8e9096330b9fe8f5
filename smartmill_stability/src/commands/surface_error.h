#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Options of the surface location error of `lobes`.
struct SurfaceRequest {
  std::string file;           ///< CSV of the map; empty: none
  double feed_mm = 0.0;       ///< per tooth
  double max_depth_mm = 0.0;  ///< of the map
  double tolerance_um = 0.0;  ///< 0: no recommendation
};

/// Writes and draws the map, and prints finishing cuts within the tolerance. @param system without a chip
/// geometry. @throws Error naming an option.
void writeSurfaceMap(const SurfaceRequest& request, const MachineModel& model,
                     const RegenerativeSystem& system, const std::vector<double>& speeds);

}  // namespace smartmill::stability
