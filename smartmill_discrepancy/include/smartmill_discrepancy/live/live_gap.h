#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/live/segment_recorder.h"

namespace smartmill::discrepancy {

struct LiveGapOptions {
  ComparedForce compared = ComparedForce::measured;
  double limit = 1.5;
  double load_step = 1.0e-4;
  double force_error = 0.05;

  void declare(ParameterTable& table) {
    table.number("limit", limit, "1", Range::above(1.0),
                 "gap (RMS difference over noise; 1 is the noise floor) above which the model does not fit");
    table.number("load_step", load_step, "1", Range::notNegative(),
                 "of full scale: resolution of the spindle load from the controller");
    table.number(
        "force_error", force_error, "1", Range::notNegative(),
        "of the RMS force of all axes: error of compensated forces that is added to the noise; 0.05 is the "
        "target of the compensation");
  }
};

/// Gap of a running machine (topic discrepancy/state).
struct LiveGap {
  double stamp = 0.0;  ///< [s] end of the segment
  std::string condition;
  std::vector<std::string> channels;
  std::vector<double> gap;  ///< [1] RMS of (measured - simulated) over noise; 1 is the noise floor
  Record simulated;         ///< simulated sensor output; empty if the segment was not compared
  bool model_fits = true;   ///< no gap is above the limit
  std::string
      exclusion;  ///< reason why the segment was not compared (chatter, another tool); empty if it was
  bool near_limit = false;  ///< too close to the stability limit for the coarse twin of explain
};

/// Model of the twin whose forces are compared. With compensated ones its force sensor is ideal and shows the
/// force on the tool in the machine's axes, with the noise of the model's.
MachineModel comparedModel(MachineModel model, ComparedForce compared);

/// Whether a cut was made with another tool than that of the model, which says nothing about it.
bool hasOtherTool(const RecordSegment& segment, const MachineModel& model);

/// Gap of one segment. fx, fy, fz are compared sample by sample (only the second half if the segment states
/// no running_before). load_meter is compared if the model has a spindle with its full scale and the segment
/// has five measurements: each against the mean simulated load, since a controller's value may be several
/// revolutions old; its noise is half a resolution step plus the simulated ripple. A chattering cut is
/// excluded, since no model follows the phase of chatter; so is the start of a cut near the stability limit,
/// whose vibrations decay slowly.
/// @throws Error if the model lacks noise_rms_n or cannot simulate the segment.
LiveGap liveGap(const MachineModel& model, const RecordSegment& segment, const LiveGapOptions& options);

/// Appends a segment to the campaign in a folder, which is created with the model if absent. The load meter
/// becomes a channel with its own rate if the model states its full scale. Segments get unique names.
/// @throws Error.
void recordSegment(const MachineModel& model, const RecordSegment& segment, const std::string& folder);

}  // namespace smartmill::discrepancy
