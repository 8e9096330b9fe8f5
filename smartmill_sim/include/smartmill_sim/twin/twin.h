#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/cutting/corner.h"
#include "smartmill_core/cutting/speed_variation.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

class CutTraces;

/// Simulated cut before a record of a running cut. Its depth grows at first, since a sudden full cut would
/// excite a long transient.
struct LeadIn {
  double time = 0.2;           ///< [s] in which the transients of tool and load meter decay
  double least_steady = 0.1;   ///< [s] a shorter time before the record is simulated as it is
  double growing_share = 0.3;  ///< [1] of the time, in which the depth grows; then the cut settles
  double first_depth = 0.01;   ///< [1] of the depth: contact from the beginning
  long steps = 32;             ///< between two depths: far more often than a tool vibrates
};

struct SimulationOptions {
  bool noise = true;       ///< sensor noise and rounding of the load meter
  std::uint64_t seed = 1;  ///< of the noise and, without a recorded angle, of the phase
  int substeps = 4;        ///< integration steps per sample, >= 1
  int corner_slices = CORNER_SLICES;
  /// [rad] spindle angle at the first sample, instead of the recorded angle's.
  std::optional<double> phase;
  /// [samples] Mean advance of the rise of the cutting force over engage_time and engagementRise().
  double early_entry = 0.0;
  /// For a tool with modes: the chip follows from the measured displacement of the tip (or from the
  /// displacement under the measured forces, see TipTrajectory), and the structure only responds to the
  /// forces. The simulation cannot become unstable, follows a chattering cut, and its residual is a
  /// prediction error.
  bool guided = false;
  /// Of a displacement under the measured forces: [1] least gain of the sensor, over its static one, above
  /// which its FRF is inverted; [s] zero padding, in which its ringing decays.
  double least_sensor_gain = 0.05, ringing = 0.2;
  /// Phases of tones (mains hum) are drawn from the seed instead of estimated from the record.
  bool random_phases = false;
  /// Channels of the record to simulate; nullptr: all. Requires channelsAreIndependent().
  const std::vector<std::string>* channels = nullptr;
  /// [s] standard deviation of the Gaussian weights of the axis acceleration (smoothedDerivative()): the -3
  /// dB frequency of 58 Hz is above the bandwidth of a feed drive's position loop, and the quantisation of an
  /// encoder is suppressed.
  double axis_smoothing = 4e-3;
  /// Cache of cut and tool in the same test (record, phase, substeps, slices) under other models, read and
  /// extended. nullptr: no cache.
  CutTraces* traces = nullptr;
  LeadIn lead_in;
  /// Variation of the spindle speed about that of the test, from the first sample on; the feed rate is
  /// constant.
  std::optional<SpeedVariation> speed_variation;
};

/// [1] Part of a sample before the engagement over which the cutting force rises: one step of the programs
/// that generate campaigns, which use smaller steps if the tool vibrates.
constexpr double engagementRise(bool vibrates) {
  return vibrates ? 1.0 / 64.0 : 1.0 / 6.0;
}

/// [rad] Spindle angle at the first sample of a record: best fit to its angles at the test's speed. 0 for a
/// tap and for a record without spindle_angle.
double recordedPhase(const CampaignTest& test, const Record& recorded);

/// Simulates one test of a campaign: a record with the columns and sample times of the recorded one. The
/// recorded spindle angle gives the phase (in a tap it is copied), the recorded hammer force excites a tap,
/// and the recorded motion of the machine axes gives their acceleration. All effects of the model act. Values
/// that are not part of a model, as the phase of a mains hum, are estimated from the recorded signals.
///
/// Before engage_time the tool is out of cut; from there it is fully engaged with the surface of steady
/// cutting. The sensor begins at rest, the load meter at its air-cut value. With running_before the record
/// begins in the steady state: a lead-in with growing depth of cut is simulated until transients have
/// decayed.
/// @param recorded columns, times, phase and hammer force
/// @throws Error naming what the model lacks or what this twin does not support.
Record simulateTest(const MachineModel& model, const CampaignTest& test, const Record& recorded,
                    const SimulationOptions& options);

/// Without a record: a cut or an air cut of a duration [s] with all columns that the model supports.
Record simulateTest(const MachineModel& model, const CampaignTest& test, double duration,
                    const SimulationOptions& options);

}  // namespace smartmill::sim
