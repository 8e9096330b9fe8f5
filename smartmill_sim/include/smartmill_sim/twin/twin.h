#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/cutting/corner.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

class CutTraces;

struct SimulationOptions {
  bool noise = true;       ///< sensor noise and rounding of the load meter
  std::uint64_t seed = 1;  ///< of the noise and, without recorded angle, of the phase
  int substeps = 4;        ///< integration steps a sample, >= 1
  int corner_slices = CORNER_SLICES;
  /// [rad] spindle angle at the first sample, instead of the recorded angle's.
  std::optional<double> phase;
  /// [samples] The force of a cut comes on so much earlier, in the mean, than engage_time and
  /// engagementRise() say.
  double early_entry = 0.0;
  /// Of a tool with modes, where a cut's record shows tool_x and tool_y: chips are those of the displacement
  /// that was measured (or, without these channels, of the one to which the forces that were measured push
  /// the tool, see Guide), the structure only shows what these forces do to it. Nothing can run away, a
  /// chattering cut is followed, and what is left is an error of prediction.
  bool guided = false;
  /// Tones (mains hum) with a phase of the seed, not with the one that the recorded signals show.
  bool random_phases = false;
  /// Channels to give, of those that the record has; nullptr: all. Only where channelsApart().
  const std::vector<std::string>* channels = nullptr;
  /// [s] deviation of the Gaussian weights by which the acceleration of the axes follows from their recorded
  /// motion (smoothedDerivative()): passes frequencies up to 58 Hz (-3 dB), above the bandwidth of a feed
  /// drive's position loop, and suppresses the resolution of an encoder.
  double axis_smoothing = 4e-3;
  /// What cut and tool did in this very test (record, phase, substeps, slices) under other models: taken from
  /// there where the model has the same values, and put there. nullptr: each simulation by itself.
  CutTraces* traces = nullptr;
};

/// [1] The force of a cut comes on over this part of a sample before the engagement: a step of the programs
/// that make campaigns, who take many more of them where the tool vibrates.
constexpr double engagementRise(bool vibrates) {
  return vibrates ? 1.0 / 64.0 : 1.0 / 6.0;
}

/// [rad] Spindle angle at a record's first sample: the phase that fits its angles best at the test's speed.
/// 0 for a tap and for a record without spindle_angle.
double recordedPhase(const CampaignTest& test, const Record& recorded);

/// Simulates one test of a campaign: a record with the columns and sample times of the recorded one. The
/// recorded spindle angle gives the phase (of a tap: stands as it is), the recorded hammer force drives a
/// tap, the recorded motion of the machine axes gives their acceleration. The effects that the model lists
/// act. What no model knows, the phase of a mains hum, is found in the recorded signals.
///
/// Before engage_time the tool is out of cut; from there full engagement with the surface that steady cutting
/// leaves. The sensor begins at rest, the load meter at its air-cut value. With running_before the record
/// begins in the steady state: the time before it is simulated, with the depth of cut growing, until the tool
/// has settled.
/// @param recorded gives columns, times, phase and hammer force
/// @throws Error naming what the model lacks or what this twin cannot run.
Record simulateTest(const MachineModel& model, const CampaignTest& test, const Record& recorded,
                    const SimulationOptions& options);

/// Without a record: a cut or an air cut of a duration [s] with every column that the model can give.
Record simulateTest(const MachineModel& model, const CampaignTest& test, double duration,
                    const SimulationOptions& options);

}  // namespace smartmill::sim
