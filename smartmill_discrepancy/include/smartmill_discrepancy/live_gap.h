#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/stretch_recorder.h"

namespace smartmill::discrepancy {

/// Gap of a running machine (topic discrepancy/state).
struct LiveGap {
  double stamp = 0.0;  ///< [s] end of the stretch
  std::string condition;
  std::vector<std::string> channels;
  std::vector<double> gap;  ///< [1] RMS of (measured - simulated) over noise; 1 is the noise floor
  bool model_fits = true;   ///< no channel's gap is above the limit
};

/// Gap of one stretch; its first half is left to the twin to settle.
/// @param limit [1] gap above which the model does not fit
/// @throws Error when the model lacks noise_rms_n or cannot simulate the stretch.
LiveGap liveGap(const MachineModel& model, const Stretch& stretch, double limit);

/// Adds a stretch to the campaign in a folder, which begins with the model: material for explain.
/// Stretches get unique names. @throws Error.
void recordStretch(const MachineModel& model, const Stretch& stretch, const std::string& folder);

}  // namespace smartmill::discrepancy
