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

/// A channel that was read a few times a second, as means over pieces of the record longer than its lag:
/// readings that follow upon another are rounded alike, so that each piece counts once.
struct SlowMeans {
  std::string channel;
  std::vector<double> mean;                ///< [unit of the channel] of each piece
  std::vector<std::vector<double>> times;  ///< [s] of its readings, since the record's first sample
  double scatter = 0.0;                    ///< [unit of the channel] of a mean, by that of its readings
  double noise = 0.0;  ///< [unit of the channel] of a mean, with the rounding that they share
  double step = 0.0;   ///< [unit of the channel] the least by which readings differ; 0: none do
};

/// How much less a channel of a guided cut is trusted than its noise says, where the model leaves more.
struct Trust {
  double noise = 1.0;    ///< [1] times the channel's noise: so much counts
  double samples = 1.0;  ///< [1] of its samples count
};

/// One test with its record as measured, ready to be compared with the twin.
struct TestData {
  CampaignTest test;
  Record record;  ///< forces as the sensor shows them; has spindle_angle for cuts, estimated where the file
                  ///< has none
  std::vector<std::string> channels;  ///< that count and that the twin gives
  std::vector<SlowMeans> slow;        ///< besides them, not in the record
  bool heldout = false;               ///< takes no part in any fit or choice
  bool phase_estimated = false;       ///< the record has no spindle angle
  std::optional<Chatter> chatter;     ///< a cut that chatters: guided, never judged as it runs freely
  bool guided = false;  ///< compared by what is predicted from one step to the next, see SimulationOptions
  std::map<std::string, Trust> trust;  ///< of channels, while guided
  double early_entry = 0.0;   ///< [samples] by which the force of the cut comes on earlier than stated
  std::size_t quiet = 0;      ///< samples before any force acts
  std::size_t first_cut = 0;  ///< first sample in cut; record.size() without cut
};

/// Whether a model with modes of the tool can be led through a cut by the displacement of the tip that its
/// record shows. Not by its forces: what a model makes of their noise would lead the model itself.
bool canBeLed(const TestData& test, const MachineModel& model);

/// A cut that was left aside because it chatters and cannot be led.
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
  std::vector<std::string> notes;          ///< what was left aside, one line each

  std::size_t samples() const;  ///< sum over tests of channels x samples
};

/// Reads every record and estimates the noise: the model's noise_rms_n where stated, else the parts of the
/// records before any force, else what the upper half of the band of the records' spectra holds between the
/// lines.
/// @throws Error on what cannot be worked with, one line naming file and cause: missing file or column, wrong
/// unit, clipped channel, no noise estimate possible.
Dataset loadDataset(const Campaign& campaign, const MachineModel& nominal);

/// The same with only the first turns of each fit cut that has its spindle angle: what a tool with modes does
/// comes again from turn to turn. Nothing where that leaves most of the samples.
std::optional<Dataset> briefOf(const Dataset& data);

/// Marks the held-out tests: about a quarter of the cuts and one air cut, at conditions inside the range of
/// the others. Cuts that chatter are neither.
void chooseHeldout(std::vector<TestData>& tests);

/// Noise RMS of a series that holds lines and slow courses beside white noise: median of the upper half of
/// its periodogram. @throws Error below 64 samples.
double noiseBetweenLines(const std::vector<double>& values);

}  // namespace smartmill::discrepancy
