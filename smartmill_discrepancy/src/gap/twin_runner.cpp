#include "smartmill_discrepancy/gap/twin_runner.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <numeric>
#include <string>
#include <thread>
#include <utility>

#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/tip_trajectory.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

constexpr std::size_t CACHED_RESULTS = 4;  // by channel of a test

// Cached traces per test: the trace of a state must outlast those of the derivatives of its cutting
// coefficients. Fine steps are used for few models.
std::size_t tracesFor(int substeps) {
  return substeps > 2 ? 2 : 8;
}

// Means of the simulated values at the times of a slow channel.
std::vector<double> meansAt(const SlowMeans& slow, const std::vector<double>& values, double sample_rate) {
  std::vector<double> means;
  for (const std::vector<double>& times : slow.times) {
    double sum = 0.0;
    for (const double t : times) {
      const double at = std::min(t * sample_rate, static_cast<double>(values.size() - 1));
      const auto before = static_cast<std::size_t>(at);
      const double share = at - static_cast<double>(before);
      sum += (1.0 - share) * values[before] + share * values[std::min(before + 1, values.size() - 1)];
    }
    means.push_back(sum / static_cast<double>(times.size()));
  }
  return means;
}

}  // namespace

void runParallel(std::size_t count, int threads, const std::function<void(std::size_t)>& job) {
  thread_local bool inside = false;
  threads = inside ? 1 : std::min(threads, static_cast<int>(count));
  std::atomic<std::size_t> next{0};
  std::vector<std::exception_ptr> failed(count);
  const auto work = [&] {
    const bool before = std::exchange(inside, inside || threads > 1);
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        job(i);
      } catch (...) {
        failed[i] = std::current_exception();
      }
    }
    inside = before;
  };
  std::vector<std::thread> others;
  for (int k = 1; k < threads; ++k) others.emplace_back(work);
  work();
  for (std::thread& t : others) t.join();
  for (const std::exception_ptr& e : failed) {
    if (e) std::rethrow_exception(e);
  }
}

TwinRunner::TwinRunner(const Dataset& data, std::vector<std::size_t> tests, int threads, int substeps)
    : data_(data), tests_(std::move(tests)), threads_(threads), substeps_(substeps) {
  for (const std::size_t t : tests_) {
    const TestData& test = data_.tests[t];
    TestCache& cache = caches_.emplace_back();
    cache.traces = std::make_unique<sim::CutTraces>(tracesFor(substeps));
    cache.record.file = test.record.file;
    cache.record.time = test.record.time;
    for (const std::string& name : test.record.names) {
      if (name != "spindle_angle") cache.record.add(name) = test.record.column(name);
    }
    cache.channels.resize(test.channels.size() + test.slow.size());
    first_span_.push_back(spans_.size());
    for (const std::string& channel : test.channels) {
      const double noise = data_.noise.at(channel);
      spans_.push_back({t, channel, size_, test.record.size(), noise, nullptr, !test.chatter});
      size_ += test.record.size();
      for (const double v : test.record.column(channel)) measured_.push_back(v / noise);
    }
    for (const SlowMeans& slow : test.slow) {
      spans_.push_back({t, slow.channel, size_, slow.mean.size(), slow.noise, &slow, !test.chatter});
      size_ += slow.mean.size();
      for (const double v : slow.mean) measured_.push_back(v / slow.noise);
      cache.record.add(slow.channel).assign(test.record.size(), 0.0);
    }
  }
  first_span_.push_back(spans_.size());
  readPhases();
  readGuidance();
}

void TwinRunner::TestCache::clear() {
  for (ChannelCache& of_channel : channels) of_channel.clear();
  traces->clear();
}

void TwinRunner::readPhases() {
  for (std::size_t k = 0; k < tests_.size(); ++k) {
    const TestData& test = data_.tests[tests_[k]];
    TestCache& cache = caches_[k];
    const std::lock_guard<std::mutex> lock(cache.mutex);
    const double phase = sim::recordedPhase(test.test, test.record);
    const bool same = phase == cache.phase && test.early_entry == cache.early_entry &&
                      test.test.spindle_speed == cache.test.spindle_speed;
    cache.phase = phase;
    cache.early_entry = test.early_entry;
    cache.test = test.test;
    if (!same) cache.clear();
  }
}

// @return whether it is unchanged
bool TwinRunner::readWeight(std::size_t b) {
  ChannelSpan& block = spans_[b];
  const TestData& test = data_.tests[block.test];
  const auto found = test.weights.find(block.channel);
  const ChannelWeight trust = test.guided && found != test.weights.end() ? found->second : ChannelWeight{};
  block.effective_samples = trust.samples * static_cast<double>(block.size);
  const double noise = trust.noise * (block.slow ? block.slow->noise : data_.noise.at(block.channel));
  if (noise == block.noise) return true;
  for (std::size_t i = block.offset; i < block.offset + block.size; ++i) measured_[i] *= block.noise / noise;
  block.noise = noise;
  return false;
}

void TwinRunner::readGuidance() {
  for (std::size_t k = 0; k < tests_.size(); ++k) {
    const TestData& test = data_.tests[tests_[k]];
    TestCache& cache = caches_[k];
    const std::lock_guard<std::mutex> lock(cache.mutex);
    bool same = cache.guided == test.guided;
    cache.guided = test.guided;
    for (std::size_t b = first_span_[k]; b < first_span_[k + 1]; ++b) same = readWeight(b) && same;
    if (same) continue;
    correction_.clear();
    cache.clear();
  }
  whitenRecords();
}

void TwinRunner::setGuided(bool guided) {
  if (guided == guided_) return;
  guided_ = guided;
  correction_.clear();
  for (TestCache& cache : caches_) {
    const std::lock_guard<std::mutex> lock(cache.mutex);
    cache.clear();
  }
}

// Traces of the cut remain valid.
void TwinRunner::setWhitening(std::vector<Whitening> of_blocks) {
  if (of_blocks.empty() && whitening_.empty()) return;
  whitening_ = std::move(of_blocks);
  correction_.clear();
  for (TestCache& cache : caches_) {
    const std::lock_guard<std::mutex> lock(cache.mutex);
    for (ChannelCache& of_channel : cache.channels) of_channel.clear();
  }
  whitenRecords();
}

void TwinRunner::whitenRecords() {
  whitened_.clear();
  if (whitening_.empty()) return;
  whitened_ = measured_;
  for (std::size_t b = 0; b < spans_.size(); ++b)
    whitening_[b].apply(whitened_.data() + spans_[b].offset, spans_[b].size);
}

void TwinRunner::setFineness(int substeps, int corner_slices) {
  if (substeps == substeps_ && corner_slices == corner_slices_) return;
  correction_.clear();
  substeps_ = substeps;
  corner_slices_ = corner_slices;
  for (TestCache& cache : caches_) {
    const std::lock_guard<std::mutex> lock(cache.mutex);
    cache.clear();
    cache.traces = std::make_unique<sim::CutTraces>(tracesFor(substeps));
  }
}

// Empty for channels that were not simulated.
SimulatedChannels TwinRunner::channelsOf(const MachineModel& model, std::size_t chosen,
                                         const CampaignTest& test,
                                         const sim::SimulationOptions& options) const {
  const Record record = sim::simulateTest(model, test, caches_[chosen].record, options);
  ++simulations_;
  SimulatedChannels result;
  for (std::size_t b = first_span_[chosen]; b < first_span_[chosen + 1]; ++b) {
    result.emplace_back();
    if (!record.has(spans_[b].channel)) continue;
    std::vector<double> values = record.column(spans_[b].channel);
    if (spans_[b].slow) values = meansAt(*spans_[b].slow, values, test.sample_rate);
    for (double& v : values) v /= spans_[b].noise;
    if (!whitening_.empty()) whitening_[b].apply(values.data(), values.size());
    result.back() = std::make_shared<const std::vector<double>>(std::move(values));
  }
  return result;
}

SimulatedChannels TwinRunner::simulateOne(const MachineModel& model, std::size_t chosen) const {
  TestCache& cache = caches_[chosen];
  const std::size_t first = first_span_[chosen], count = first_span_[chosen + 1] - first;
  // Channels that are not separable depend on the complete record; guiding forces couple the channels.
  const bool separable = sim::channelsAreIndependent(model) &&
                         !(guides(chosen) && sim::TipTrajectory::isFromForce(cache.record));
  SimulatedChannels result(count);
  std::vector<std::vector<double>> keys;
  std::vector<std::string> missing;
  for (std::size_t c = 0; c < count; ++c) {
    const std::string& channel = spans_[first + c].channel;
    keys.push_back(separable ? sim::valuesOfChannel(model, cache.test.kind, channelOf(channel))
                             : sim::valuesOfRecord(model, cache.test.kind));
    const std::lock_guard<std::mutex> lock(cache.mutex);
    for (const auto& [values, channels] : cache.channels[c]) {
      if (values == keys[c]) result[c] = channels;
    }
    if (!result[c]) missing.push_back(channel);
  }
  if (missing.empty()) return result;
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = substeps_;
  options.corner_slices = corner_slices_;
  options.guided = guides(chosen);
  options.phase = cache.phase;
  options.early_entry = cache.early_entry;
  options.traces = cache.traces.get();
  if (separable) options.channels = &missing;
  const SimulatedChannels fresh = channelsOf(model, chosen, cache.test, options);
  const std::lock_guard<std::mutex> lock(cache.mutex);
  for (std::size_t c = 0; c < count; ++c) {
    if (result[c]) continue;
    result[c] = fresh[c];
    cache.channels[c].emplace_front(std::move(keys[c]), fresh[c]);
    if (cache.channels[c].size() > CACHED_RESULTS) cache.channels[c].pop_back();
  }
  return result;
}

SimulatedChannels TwinRunner::realigned(const MachineModel& model, const SimulatedChannels& base,
                                        std::size_t chosen, const RecordAlignment& by) const {
  const TestCache& cache = caches_[chosen];
  CampaignTest test = cache.test;
  test.spindle_speed = alignedSpeed(data_.tests[tests_[chosen]], test.spindle_speed, by);
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = substeps_;
  options.corner_slices = corner_slices_;
  options.guided = guides(chosen);
  options.phase = alignedPhase(cache.phase, by);
  options.early_entry = cache.early_entry + by.entry;
  SimulatedChannels of_test = channelsOf(model, chosen, test, options), all = base;
  std::move(of_test.begin(), of_test.end(), all.begin() + static_cast<std::ptrdiff_t>(first_span_[chosen]));
  return all;
}

std::vector<SimulatedChannels> TwinRunner::simulateChannels(const std::vector<MachineModel>& models) const {
  std::vector<SimulatedChannels> results(models.size(), SimulatedChannels(spans_.size()));
  runParallel(models.size() * tests_.size(), threads_, [&](std::size_t job) {
    const std::size_t k = job / models.size(), m = job % models.size();
    SimulatedChannels of_test = simulateOne(models[m], k);
    std::move(of_test.begin(), of_test.end(),
              results[m].begin() + static_cast<std::ptrdiff_t>(first_span_[k]));
  });
  return results;
}

std::vector<double> TwinRunner::joined(const SimulatedChannels& blocks) const {
  std::vector<double> all;
  all.reserve(size_);
  for (const auto& block : blocks) all.insert(all.end(), block->begin(), block->end());
  for (std::size_t i = 0; i < correction_.size(); ++i) all[i] += correction_[i];
  return all;
}

void TwinRunner::compare(const SimulatedChannels& simulated, std::size_t block, double* difference) const {
  const ChannelSpan& b = spans_[block];
  const std::vector<double>&values = *simulated[block], &records = measured();
  for (std::size_t i = 0; i < b.size; ++i) difference[i] = values[i] - records[b.offset + i];
  for (std::size_t i = 0; i < b.size && !correction_.empty(); ++i) difference[i] += correction_[b.offset + i];
}

std::vector<std::vector<double>> TwinRunner::simulate(const std::vector<MachineModel>& models) const {
  std::vector<std::vector<double>> results;
  for (const SimulatedChannels& blocks : simulateChannels(models)) results.push_back(joined(blocks));
  return results;
}

void TwinRunner::correctTo(const MachineModel& reference, const std::vector<double>& exact) {
  correction_.clear();
  const std::vector<double> mine = simulate(reference);
  correction_.resize(size_);
  for (std::size_t i = 0; i < size_; ++i) correction_[i] = exact[i] - mine[i];
}

std::vector<double> TwinRunner::simulate(const MachineModel& model) const {
  return std::move(simulate(std::vector<MachineModel>{model}).front());
}

double TwinRunner::effectiveSamples() const {
  return std::accumulate(spans_.begin(), spans_.end(), 0.0,
                         [](double sum, const ChannelSpan& b) { return sum + b.effective_samples; });
}

std::vector<double> residualOf(const TwinRunner& runner, const MachineModel& model) {
  std::vector<double> residual = runner.simulate(model);
  for (std::size_t i = 0; i < residual.size(); ++i) residual[i] = runner.measured()[i] - residual[i];
  return residual;
}

double residualSquares(const TwinRunner& runner, const std::vector<double>& simulated) {
  double squares = 0.0;
  for (std::size_t i = 0; i < simulated.size(); ++i)
    squares += std::pow(runner.measured()[i] - simulated[i], 2);
  return squares;
}

}  // namespace smartmill::discrepancy
