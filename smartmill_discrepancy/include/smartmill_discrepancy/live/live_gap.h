#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/live/stretch_recorder.h"

namespace smartmill::discrepancy {

struct LiveGapOptions {
  double limit = 1.5;
  double load_step = 1.0e-4;

  void declare(ParameterTable& table) {
    table.number("limit", limit, "1", Range::above(1.0),
                 "gap (RMS difference over noise; 1 is the noise floor) above which the model does not fit");
    table.number("load_step", load_step, "1", Range::notNegative(),
                 "of full scale: smallest step in which the controller tells the spindle's load");
  }
};

/// Gap of a running machine (topic discrepancy/state).
struct LiveGap {
  double stamp = 0.0;  ///< [s] end of the stretch
  std::string condition;
  std::vector<std::string> channels;
  std::vector<double> gap;   ///< [1] RMS of (measured - simulated) over noise; 1 is the noise floor
  Record simulated;          ///< what the twin's sensor shows in the stretch; empty: nothing was compared
  bool model_fits = true;    ///< no channel's gap is above the limit
  std::string aside;         ///< why nothing was compared (chatter); empty: it was
  bool at_the_edge = false;  ///< so near the stability limit that explain's faster twin does not follow it
};

/// Gap of one stretch. fx, fy, fz: sample by sample (of a stretch that states no running_before the second
/// half). load_meter, where the model has a spindle with its full scale and the stretch has five readings:
/// each reading against the mean of the simulated load, since a controller's reading may be old by some
/// revolutions; its noise is half a step of the reading and the simulated ripple. A cut that chatters is set
/// aside, as no model follows the phase of chatter; so is the begin of one near the stability limit, whose
/// vibrations die out slowly.
/// @throws Error when the model lacks noise_rms_n or cannot simulate the stretch.
LiveGap liveGap(const MachineModel& model, const Stretch& stretch, const LiveGapOptions& options);

/// Adds a stretch to the campaign in a folder, which begins with the model: material for explain. Its load
/// meter as a channel of its own rate, where the model knows its full scale. Stretches get unique names.
/// @throws Error.
void recordStretch(const MachineModel& model, const Stretch& stretch, const std::string& folder);

}  // namespace smartmill::discrepancy
