#include "smartmill_discrepancy/gap/twin_runner.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <numeric>
#include <string>
#include <thread>
#include <utility>

#include "smartmill_sim/effects/effect.h"
#include "smartmill_sim/twin/guide.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

constexpr std::size_t KEPT_RESULTS = 4;  // of each channel of a test

// Traces of a test that are held: that of a state must outlast those of the tangents of its cutting
// coefficients. Fine steps are for few models.
std::size_t tracesFor(int substeps) {
  return substeps > 2 ? 2 : 8;
}

// What a channel that is read now and then would have shown.
std::vector<double> readAt(const SlowMeans& slow, const std::vector<double>& values, double sample_rate) {
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
    Kept& kept = kept_.emplace_back();
    kept.traces = std::make_unique<sim::CutTraces>(tracesFor(substeps));
    kept.record.file = test.record.file;
    kept.record.time = test.record.time;
    for (const std::string& name : test.record.names) {
      if (name != "spindle_angle") kept.record.add(name) = test.record.column(name);
    }
    kept.shown.resize(test.channels.size() + test.slow.size());
    first_block_.push_back(blocks_.size());
    for (const std::string& channel : test.channels) {
      const double noise = data_.noise.at(channel);
      blocks_.push_back({t, channel, size_, test.record.size(), noise, nullptr, !test.chatter});
      size_ += test.record.size();
      for (const double v : test.record.column(channel)) measured_.push_back(v / noise);
    }
    for (const SlowMeans& slow : test.slow) {
      blocks_.push_back({t, slow.channel, size_, slow.mean.size(), slow.noise, &slow, !test.chatter});
      size_ += slow.mean.size();
      for (const double v : slow.mean) measured_.push_back(v / slow.noise);
      kept.record.add(slow.channel).assign(test.record.size(), 0.0);
    }
  }
  first_block_.push_back(blocks_.size());
  readPhases();
  readGuidance();
}

void TwinRunner::Kept::forget() {
  for (Shown& of_channel : shown) of_channel.clear();
  traces->clear();
}

void TwinRunner::readPhases() {
  for (std::size_t k = 0; k < tests_.size(); ++k) {
    const TestData& test = data_.tests[tests_[k]];
    Kept& kept = kept_[k];
    const std::lock_guard<std::mutex> lock(kept.mutex);
    const double phase = sim::recordedPhase(test.test, test.record);
    const bool same = phase == kept.phase && test.early_entry == kept.early_entry &&
                      test.test.spindle_speed == kept.test.spindle_speed;
    kept.phase = phase;
    kept.early_entry = test.early_entry;
    kept.test = test.test;
    if (!same) kept.forget();
  }
}

// @return whether it is what it was
bool TwinRunner::readTrust(std::size_t b) {
  Block& block = blocks_[b];
  const TestData& test = data_.tests[block.test];
  const auto told = test.trust.find(block.channel);
  const Trust trust = test.guided && told != test.trust.end() ? told->second : Trust{};
  block.counts = trust.samples * static_cast<double>(block.size);
  const double noise = trust.noise * (block.slow ? block.slow->noise : data_.noise.at(block.channel));
  if (noise == block.noise) return true;
  for (std::size_t i = block.offset; i < block.offset + block.size; ++i) measured_[i] *= block.noise / noise;
  block.noise = noise;
  return false;
}

void TwinRunner::readGuidance() {
  for (std::size_t k = 0; k < tests_.size(); ++k) {
    const TestData& test = data_.tests[tests_[k]];
    Kept& kept = kept_[k];
    const std::lock_guard<std::mutex> lock(kept.mutex);
    bool same = kept.guided == test.guided;
    kept.guided = test.guided;
    for (std::size_t b = first_block_[k]; b < first_block_[k + 1]; ++b) same = readTrust(b) && same;
    if (same) continue;
    correction_.clear();
    kept.forget();
  }
  whitenRecords();
}

void TwinRunner::setGuided(bool guided) {
  if (guided == guided_) return;
  guided_ = guided;
  correction_.clear();
  for (Kept& kept : kept_) {
    const std::lock_guard<std::mutex> lock(kept.mutex);
    kept.forget();
  }
}

// What the tool did stays known.
void TwinRunner::setWhitening(std::vector<Whitening> of_blocks) {
  if (of_blocks.empty() && whitening_.empty()) return;
  whitening_ = std::move(of_blocks);
  correction_.clear();
  for (Kept& kept : kept_) {
    const std::lock_guard<std::mutex> lock(kept.mutex);
    for (Shown& of_channel : kept.shown) of_channel.clear();
  }
  whitenRecords();
}

void TwinRunner::whitenRecords() {
  whitened_.clear();
  if (whitening_.empty()) return;
  whitened_ = measured_;
  for (std::size_t b = 0; b < blocks_.size(); ++b)
    whitening_[b].apply(whitened_.data() + blocks_[b].offset, blocks_[b].size);
}

void TwinRunner::setFineness(int substeps, int corner_slices) {
  if (substeps == substeps_ && corner_slices == corner_slices_) return;
  correction_.clear();
  substeps_ = substeps;
  corner_slices_ = corner_slices;
  for (Kept& kept : kept_) {
    const std::lock_guard<std::mutex> lock(kept.mutex);
    kept.forget();
    kept.traces = std::make_unique<sim::CutTraces>(tracesFor(substeps));
  }
}

// Empty where a channel was not asked for.
SimulatedBlocks TwinRunner::blocksOf(const MachineModel& model, std::size_t chosen, const CampaignTest& test,
                                     const sim::SimulationOptions& options) const {
  const Record record = sim::simulateTest(model, test, kept_[chosen].record, options);
  ++simulations_;
  SimulatedBlocks result;
  for (std::size_t b = first_block_[chosen]; b < first_block_[chosen + 1]; ++b) {
    result.emplace_back();
    if (!record.has(blocks_[b].channel)) continue;
    std::vector<double> values = record.column(blocks_[b].channel);
    if (blocks_[b].slow) values = readAt(*blocks_[b].slow, values, test.sample_rate);
    for (double& v : values) v /= blocks_[b].noise;
    if (!whitening_.empty()) whitening_[b].apply(values.data(), values.size());
    result.back() = std::make_shared<const std::vector<double>>(std::move(values));
  }
  return result;
}

SimulatedBlocks TwinRunner::simulateOne(const MachineModel& model, std::size_t chosen) const {
  Kept& kept = kept_[chosen];
  const std::size_t first = first_block_[chosen], count = first_block_[chosen + 1] - first;
  // Channels that are not apart are as much as the record; forces that guide the tool lead from one to the
  // next.
  const bool apart = sim::channelsApart(model) && !(guides(chosen) && sim::Guide::byForce(kept.record));
  SimulatedBlocks result(count);
  std::vector<std::vector<double>> keys;
  std::vector<std::string> missing;
  for (std::size_t c = 0; c < count; ++c) {
    const std::string& channel = blocks_[first + c].channel;
    keys.push_back(apart ? sim::valuesOfChannel(model, kept.test.kind, sim::channelOf(channel))
                         : sim::valuesOfRecord(model, kept.test.kind));
    const std::lock_guard<std::mutex> lock(kept.mutex);
    for (const auto& [values, shown] : kept.shown[c]) {
      if (values == keys[c]) result[c] = shown;
    }
    if (!result[c]) missing.push_back(channel);
  }
  if (missing.empty()) return result;
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = substeps_;
  options.corner_slices = corner_slices_;
  options.guided = guides(chosen);
  options.phase = kept.phase;
  options.early_entry = kept.early_entry;
  options.traces = kept.traces.get();
  if (apart) options.channels = &missing;
  const SimulatedBlocks fresh = blocksOf(model, chosen, kept.test, options);
  const std::lock_guard<std::mutex> lock(kept.mutex);
  for (std::size_t c = 0; c < count; ++c) {
    if (result[c]) continue;
    result[c] = fresh[c];
    kept.shown[c].emplace_front(std::move(keys[c]), fresh[c]);
    if (kept.shown[c].size() > KEPT_RESULTS) kept.shown[c].pop_back();
  }
  return result;
}

SimulatedBlocks TwinRunner::turned(const MachineModel& model, const SimulatedBlocks& base, std::size_t chosen,
                                   const Turn& by) const {
  const Kept& kept = kept_[chosen];
  CampaignTest test = kept.test;
  test.spindle_speed = turnedSpeed(data_.tests[tests_[chosen]], test.spindle_speed, by);
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = substeps_;
  options.corner_slices = corner_slices_;
  options.guided = guides(chosen);
  options.phase = turnedPhase(kept.phase, by);
  options.early_entry = kept.early_entry + by.entry;
  SimulatedBlocks of_test = blocksOf(model, chosen, test, options), all = base;
  std::move(of_test.begin(), of_test.end(), all.begin() + static_cast<std::ptrdiff_t>(first_block_[chosen]));
  return all;
}

std::vector<SimulatedBlocks> TwinRunner::simulateBlocks(const std::vector<MachineModel>& models) const {
  std::vector<SimulatedBlocks> results(models.size(), SimulatedBlocks(blocks_.size()));
  runParallel(models.size() * tests_.size(), threads_, [&](std::size_t job) {
    const std::size_t k = job / models.size(), m = job % models.size();
    SimulatedBlocks of_test = simulateOne(models[m], k);
    std::move(of_test.begin(), of_test.end(),
              results[m].begin() + static_cast<std::ptrdiff_t>(first_block_[k]));
  });
  return results;
}

std::vector<double> TwinRunner::joined(const SimulatedBlocks& blocks) const {
  std::vector<double> all;
  all.reserve(size_);
  for (const auto& block : blocks) all.insert(all.end(), block->begin(), block->end());
  for (std::size_t i = 0; i < correction_.size(); ++i) all[i] += correction_[i];
  return all;
}

void TwinRunner::compare(const SimulatedBlocks& simulated, std::size_t block, double* apart) const {
  const Block& b = blocks_[block];
  const std::vector<double>&values = *simulated[block], &records = measured();
  for (std::size_t i = 0; i < b.size; ++i) apart[i] = values[i] - records[b.offset + i];
  for (std::size_t i = 0; i < b.size && !correction_.empty(); ++i) apart[i] += correction_[b.offset + i];
}

std::vector<std::vector<double>> TwinRunner::simulate(const std::vector<MachineModel>& models) const {
  std::vector<std::vector<double>> results;
  for (const SimulatedBlocks& blocks : simulateBlocks(models)) results.push_back(joined(blocks));
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

double TwinRunner::counts() const {
  return std::accumulate(blocks_.begin(), blocks_.end(), 0.0,
                         [](double sum, const Block& b) { return sum + b.counts; });
}

double squaresLeft(const TwinRunner& runner, const std::vector<double>& simulated) {
  double squares = 0.0;
  for (std::size_t i = 0; i < simulated.size(); ++i)
    squares += std::pow(runner.measured()[i] - simulated[i], 2);
  return squares;
}

}  // namespace smartmill::discrepancy
