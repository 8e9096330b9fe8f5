#pragma once

#include <atomic>
#include <cstddef>
#include <deque>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/data/alignment.h"
#include "smartmill_discrepancy/gap/campaign_channels.h"
#include "smartmill_sim/twin/cut_traces.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {

/// How a twin is simulated.
struct TwinSettings {
  int substeps = 1;                   ///< per sample
  int corner_slices = CORNER_SLICES;  ///< of a tool's corner
  bool guided = false;  ///< tools with modes by the recorded displacement of the tip, see SimulationOptions
};

/// The twin of one test with its last results. Most model values affect few channels: a tap does not depend
/// on the cutting coefficients, a sensor mode affects one axis.
class TestTwin {
 public:
  /// @param test, channels must outlive this object @param chosen the test's index in the channels
  TestTwin(const TestData& test, const CampaignChannels& channels, std::size_t chosen, int substeps);

  /// Simulated channels of the test. @param simulations counts the simulated tests @throws Error of the twin
  SimulatedChannels simulate(const MachineModel& model, const TwinSettings& settings,
                             std::atomic<std::size_t>* simulations);
  /// The same with a changed alignment, without using results or keeping them.
  SimulatedChannels realigned(const MachineModel& model, const TwinSettings& settings,
                              const RecordAlignment& by) const;

  /// Reads phase, speed and entry of the record again.
  void readPhase();
  /// Reads again whether the test is guided. @return whether this changed
  bool readGuidance();

  /// Forgets all results.
  void clear();
  /// Forgets the simulated channels; traces of the cut remain valid.
  void clearChannels();
  /// Forgets all results, for other steps.
  void restart(int substeps);

 private:
  // Simulated values of a channel by the model values that affect it, the newest first.
  using ChannelCache = std::deque<std::pair<std::vector<double>, std::shared_ptr<const std::vector<double>>>>;
  sim::SimulationOptions optionsOf(const TwinSettings& settings) const;
  std::vector<double> keyOf(const MachineModel& model, std::size_t channel, bool separable) const;
  SimulatedChannels channelsOf(const MachineModel& model, const CampaignTest& test,
                               const sim::SimulationOptions& options) const;

  const TestData& test_data_;
  const CampaignChannels& layout_;
  std::size_t chosen_;
  Record record_;  // for the twin
  CampaignTest test_;
  double phase_ = 0.0, early_entry_ = 0.0;
  bool guided_ = false;
  std::mutex mutex_;
  std::vector<ChannelCache> results_;  // by channel
  std::unique_ptr<sim::CutTraces> traces_;
};

}  // namespace smartmill::discrepancy
