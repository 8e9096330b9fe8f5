#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_discrepancy/data/chatter.h"

namespace smartmill::discrepancy {

/// Force channels in the order of the axes x, y, z.
inline const std::vector<std::string> FORCES(FORCE_CHANNELS.begin(), FORCE_CHANNELS.end());

/// [1] of the sample rate: highest frequency at which modes and lines are searched, with a margin to the
/// Nyquist frequency.
constexpr double USABLE_BAND = 0.42;
/// [Hz] Lowest frequency at which modes and bursts are searched: below, the residual is drift and hum.
constexpr double LOWEST_MODE = 60.0;
/// [1] Damping ratio at which an unknown mode of sensor or structure is searched.
constexpr double TYPICAL_DAMPING = 0.04;

/// Of the twin per sample where phases and labels are compared, which need no accurate forces.
constexpr int COARSE_SUBSTEPS = 2;

/// Channel sampled a few times per second, as means over intervals longer than its lag. Consecutive samples
/// share their rounding error, so each interval counts as one value.
struct SlowMeans {
  std::string channel;
  std::vector<double> mean;                ///< [unit of the channel] of each interval
  std::vector<std::vector<double>> times;  ///< [s] of its samples, from the record's first sample
  double scatter = 0.0;  ///< [unit of the channel] standard error of a mean, from the scatter of its samples
  double noise = 0.0;    ///< [unit of the channel] of a mean, including the common rounding error
  double step = 0.0;     ///< [unit of the channel] smallest difference between samples; 0: all are equal
};

/// Reduced weight of a channel of a guided cut whose residual exceeds its noise.
struct ChannelWeight {
  double noise = 1.0;    ///< [1] factor on the channel's noise
  double samples = 1.0;  ///< [1] share of its samples that count as independent
};

/// One test with its measured record, ready for comparison with the twin.
struct TestData {
  CampaignTest test;
  Record record;  ///< forces as indicated by the sensor; spindle_angle of cuts is estimated if not recorded
  std::vector<std::string> channels;  ///< compared channels, which the twin simulates too
  std::vector<SlowMeans> slow;        ///< further channels that are not in the record
  bool heldout = false;               ///< takes no part in any fit or choice
  bool phase_estimated = false;       ///< the record has no spindle angle
  std::optional<Chatter> chatter;  ///< a chattering cut: always guided, never compared with a free simulation
  bool guided = false;             ///< compared by one-step prediction, see SimulationOptions
  std::map<std::string, ChannelWeight> weights;  ///< by channel, while guided
  double early_entry = 0.0;   ///< [samples] by which the cutting force starts earlier than stated
  std::size_t quiet = 0;      ///< samples before any force acts
  std::size_t first_cut = 0;  ///< first sample in cut; record.size() without cut

  /// First sample of the steady part of a cut, after the transients of entry and sensor.
  std::size_t steadyBegin() const { return first_cut + (record.size() - first_cut) / 8; }
};

/// Whether the tool of a model vibrates.
bool hasToolModes(const MachineModel& model);

/// Whether a model with tool modes can be guided through a cut by the recorded displacement of the tool tip.
/// Recorded forces do not qualify: the model would be guided by its own response to their noise.
bool canBeGuided(const TestData& test, const MachineModel& model);

/// A cut that is excluded because it chatters and cannot be guided.
struct ChatteringTest {
  TestData data;
  Chatter chatter;
};

/// A campaign in memory.
struct Dataset {
  Campaign campaign;
  MachineModel nominal;
  std::vector<TestData> tests;
  std::vector<ChatteringTest> chattering;  ///< not among tests
  std::map<std::string, double> noise;     ///< RMS of each channel [unit of the channel]
  std::vector<std::string> notes;          ///< exclusions, one line each
  std::vector<std::string> stream_shifts;  ///< corrected, one line each

  std::size_t samples() const;  ///< sum over tests of channels x samples
};

/// Reads every record and estimates the noise RMS: the model's noise_rms_n if stated, else the parts of the
/// records before any force, else the upper half of the records' spectra between the lines.
/// @throws Error naming file and cause: missing file or column, wrong unit, clipped channel, no noise
/// estimate possible.
Dataset loadDataset(const Campaign& campaign, const MachineModel& nominal);

/// The same data with only the first revolutions of each fitted cut that has a spindle angle.
/// @return nothing if most of the samples would remain
std::optional<Dataset> shortenedDataset(const Dataset& data);

/// Marks the held-out tests: about a quarter of the cuts and one air cut, at conditions inside the range of
/// the others. Chattering cuts are never held out.
void chooseHeldout(std::vector<TestData>& tests);

/// Noise RMS of a series with lines and slow trends: median of the upper half of its periodogram.
/// @throws Error below 64 samples.
double noiseBetweenLines(const std::vector<double>& values);

}  // namespace smartmill::discrepancy
