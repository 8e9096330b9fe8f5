#include "smartmill_discrepancy/gap/test_twin.h"

#include <string>

#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/tip_trajectory.h"

namespace smartmill::discrepancy {
namespace {

/// Memory against time; results do not depend on it.
struct TwinCacheOptions {
  std::size_t results = 4;  ///< of each channel: those of a state and of the last derivatives
  /// Traces of a cut: that of a state must outlast those of the derivatives of its cutting coefficients. Fine
  /// steps are used for few models.
  std::size_t traces = 8, fine_traces = 2;
  int fine_substeps = 3;  ///< from which steps are fine
};

const TwinCacheOptions LIMITS;

}  // namespace

TestTwin::TestTwin(const TestData& test, const CampaignChannels& channels, std::size_t chosen, int substeps)
    : test_data_(test), layout_(channels), chosen_(chosen) {
  restart(substeps);
  record_.file = test.record.file;
  record_.time = test.record.time;
  for (const std::string& name : test.record.names) {
    if (name != "spindle_angle") record_.add(name) = test.record.column(name);
  }
  for (const SlowMeans& slow : test.slow) record_.add(slow.channel).assign(test.record.size(), 0.0);
  results_.resize(test.channels.size() + test.slow.size());
}

void TestTwin::clear() {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (ChannelCache& of_channel : results_) of_channel.clear();
  traces_->clear();
}

void TestTwin::clearChannels() {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (ChannelCache& of_channel : results_) of_channel.clear();
}

void TestTwin::restart(int substeps) {
  clearChannels();
  traces_ =
      std::make_unique<sim::CutTraces>(substeps < LIMITS.fine_substeps ? LIMITS.traces : LIMITS.fine_traces);
}

void TestTwin::readPhase() {
  const TestData& test = test_data_;
  const double phase = sim::recordedPhase(test.test, test.record);
  const bool same =
      phase == phase_ && test.early_entry == early_entry_ && test.test.spindle_speed == test_.spindle_speed;
  phase_ = phase;
  early_entry_ = test.early_entry;
  test_ = test.test;
  if (!same) clear();
}

bool TestTwin::readGuidance() {
  const bool before = guided_;
  guided_ = test_data_.guided;
  return guided_ != before;
}

sim::SimulationOptions TestTwin::optionsOf(const TwinSettings& settings) const {
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = settings.substeps;
  options.corner_slices = settings.corner_slices;
  options.guided = settings.guided || guided_;
  options.phase = phase_;
  options.early_entry = early_entry_;
  return options;
}

// Empty for channels that were not simulated.
SimulatedChannels TestTwin::channelsOf(const MachineModel& model, const CampaignTest& test,
                                       const sim::SimulationOptions& options) const {
  const Record record = sim::simulateTest(model, test, record_, options);
  SimulatedChannels result;
  for (std::size_t b = layout_.begin(chosen_); b < layout_.end(chosen_); ++b) {
    const std::string& channel = layout_.spans()[b].channel;
    result.emplace_back();
    if (record.has(channel))
      result.back() =
          std::make_shared<const std::vector<double>>(layout_.normalised(b, record.column(channel)));
  }
  return result;
}

// Model values that affect a channel.
std::vector<double> TestTwin::keyOf(const MachineModel& model, std::size_t channel, bool separable) const {
  const std::string& name = layout_.spans()[layout_.begin(chosen_) + channel].channel;
  return separable ? sim::valuesOfChannel(model, test_.kind, channelOf(name))
                   : sim::valuesOfRecord(model, test_.kind);
}

SimulatedChannels TestTwin::simulate(const MachineModel& model, const TwinSettings& settings,
                                     std::atomic<std::size_t>* simulations) {
  sim::SimulationOptions options = optionsOf(settings);
  // Channels that are not separable depend on the complete record; guiding forces couple the channels.
  const bool separable =
      sim::channelsAreIndependent(model) && !(options.guided && sim::TipTrajectory::isFromForce(record_));
  SimulatedChannels result(results_.size());
  std::vector<std::vector<double>> keys;
  std::vector<std::string> missing;
  for (std::size_t c = 0; c < result.size(); ++c) {
    keys.push_back(keyOf(model, c, separable));
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& [values, channels] : results_[c]) {
      if (values == keys[c]) result[c] = channels;
    }
    if (!result[c]) missing.push_back(layout_.spans()[layout_.begin(chosen_) + c].channel);
  }
  if (missing.empty()) return result;
  options.traces = traces_.get();
  if (separable) options.channels = &missing;
  const SimulatedChannels fresh = channelsOf(model, test_, options);
  ++*simulations;
  const std::lock_guard<std::mutex> lock(mutex_);
  for (std::size_t c = 0; c < result.size(); ++c) {
    if (result[c]) continue;
    result[c] = fresh[c];
    results_[c].emplace_front(std::move(keys[c]), fresh[c]);
    if (results_[c].size() > LIMITS.results) results_[c].pop_back();
  }
  return result;
}

SimulatedChannels TestTwin::realigned(const MachineModel& model, const TwinSettings& settings,
                                      const RecordAlignment& by) const {
  CampaignTest test = test_;
  test.spindle_speed = alignedSpeed(test_data_, test.spindle_speed, by);
  sim::SimulationOptions options = optionsOf(settings);
  options.phase = alignedPhase(phase_, by);
  options.early_entry += by.entry;
  return channelsOf(model, test, options);
}

}  // namespace smartmill::discrepancy
