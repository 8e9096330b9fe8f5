#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// AMPLITUDE:RATIO or AMPLITUDE:RATIO:triangle. @throws Error naming the option.
SpeedVariation speedVariationOf(const std::string& text);

/// Options of the speed variation of `lobes`.
struct VariationRequest {
  std::string file;  ///< CSV of the limits
  double max_depth_mm = 0.0;
  SpeedVariation variation;
  double best_rpm = 0.0;  ///< 0: no search
};

/// Writes and draws the limits with and without the variation over mean speeds, and prints what it gains.
/// @param varied, steady limits at each speed [rad/s]
void writeVariedChart(const VariationRequest& request, const std::vector<double>& speeds,
                      const std::vector<Limit>& varied, const std::vector<Limit>& steady);

/// Prints the best variation up to that of the request at one speed. @param system without a variation
void printBestVariation(const VariationRequest& request, const MachineModel& model,
                        const RegenerativeSystem& system);

}  // namespace smartmill::stability
