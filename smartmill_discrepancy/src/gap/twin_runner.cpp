#include "smartmill_discrepancy/gap/twin_runner.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <string>
#include <thread>
#include <utility>

#include "smartmill_sim/effects/effect.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

constexpr std::size_t KEPT_RESULTS = 4;  // of each test

void append(std::vector<double>& key, const ModalModel& modes) {
  key.push_back(static_cast<double>(modes.modes.size()));
  for (const Mode& m : modes.modes) key.insert(key.end(), {m.frequency, m.damping_ratio, m.gain});
  key.push_back(modes.direct);
}

// Every value that the record of a test of this kind depends on.
std::vector<double> valuesFor(const MachineModel& model, TestKind kind) {
  std::vector<double> key;
  if (kind == TestKind::cut) {
    if (const auto& t = model.tool) {
      key.insert(key.end(), {static_cast<double>(t->teeth), t->diameter, t->helix});
      key.insert(key.end(), t->pitch.begin(), t->pitch.end());
    }
    if (const auto& c = model.cutting)
      key.insert(key.end(), {c->ktc, c->krc, c->kac, c->kte, c->kre, c->kae});
  }
  append(key, model.tool_tip.x);
  append(key, model.tool_tip.y);
  for (const ModalModel& a : model.force_sensor.axis) append(key, a);
  if (const auto& s = model.spindle; s && kind != TestKind::tap) {
    key.insert(key.end(), {s->viscous, s->coulomb, s->load_meter_gain, s->load_meter_bandwidth,
                           s->load_meter_resolution, s->friction_zero_below});
  }
  for (const EffectEntry& effect : model.effects) {
    const EffectKind* known = findEffect(effect.name);
    if (known && !sim::touches(known->stage, kind)) continue;
    key.push_back(static_cast<double>(std::hash<std::string>()(effect.name)));
    for (const auto& [name, value] : effect.numbers) {
      key.push_back(static_cast<double>(std::hash<std::string>()(name)));
      key.push_back(value);
    }
    for (const auto& [name, word] : effect.words)
      key.push_back(static_cast<double>(std::hash<std::string>()(name + "=" + word)));
    for (const auto& [name, list] : effect.lists) {
      key.push_back(static_cast<double>(std::hash<std::string>()(name)));
      key.insert(key.end(), list.begin(), list.end());
    }
    append(key, effect.flexibility.x);
    append(key, effect.flexibility.y);
  }
  return key;
}

}  // namespace

void runParallel(std::size_t count, int threads, const std::function<void(std::size_t)>& job) {
  std::atomic<std::size_t> next{0};
  std::vector<std::exception_ptr> failed(count);
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        job(i);
      } catch (...) {
        failed[i] = std::current_exception();
      }
    }
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
    kept.record.file = test.record.file;
    kept.record.time = test.record.time;
    for (const std::string& name : test.record.names) {
      if (name != "spindle_angle") kept.record.add(name) = test.record.column(name);
    }
    first_block_.push_back(blocks_.size());
    for (const std::string& channel : test.channels) {
      const double noise = data_.noise.at(channel);
      blocks_.push_back({t, channel, size_, test.record.size(), noise});
      size_ += test.record.size();
      for (const double v : test.record.column(channel)) measured_.push_back(v / noise);
    }
  }
  first_block_.push_back(blocks_.size());
  readPhases();
}

void TwinRunner::readPhases() {
  for (std::size_t k = 0; k < tests_.size(); ++k) {
    const TestData& test = data_.tests[tests_[k]];
    const std::lock_guard<std::mutex> lock(kept_[k].mutex);
    kept_[k].phase = sim::recordedPhase(test.test, test.record);
    kept_[k].results.clear();
  }
}

void TwinRunner::setSubsteps(int substeps) {
  substeps_ = substeps;
  for (Kept& kept : kept_) {
    const std::lock_guard<std::mutex> lock(kept.mutex);
    kept.results.clear();
  }
}

std::vector<double> TwinRunner::simulateOne(const MachineModel& model, std::size_t chosen) const {
  const TestData& test = data_.tests[tests_[chosen]];
  Kept& kept = kept_[chosen];
  std::vector<double> key = valuesFor(model, test.test.kind);
  {
    const std::lock_guard<std::mutex> lock(kept.mutex);
    for (const auto& [values, result] : kept.results) {
      if (values == key) return result;
    }
  }
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = substeps_;
  options.phase = kept.phase;
  const Record record = sim::simulateTest(model, test.test, kept.record, options);
  ++simulations_;
  std::vector<double> result;
  result.reserve(test.channels.size() * record.size());
  for (std::size_t b = first_block_[chosen]; b < first_block_[chosen + 1]; ++b) {
    for (const double v : record.column(blocks_[b].channel)) result.push_back(v / blocks_[b].noise);
  }
  const std::lock_guard<std::mutex> lock(kept.mutex);
  kept.results.emplace_front(std::move(key), result);
  if (kept.results.size() > KEPT_RESULTS) kept.results.pop_back();
  return result;
}

std::vector<std::vector<double>> TwinRunner::simulate(const std::vector<MachineModel>& models) const {
  std::vector<std::vector<double>> results(models.size(), std::vector<double>(size_));
  runParallel(models.size() * tests_.size(), threads_, [&](std::size_t job) {
    const std::size_t m = job / tests_.size(), k = job % tests_.size();
    const std::vector<double> values = simulateOne(models[m], k);
    const std::size_t from = blocks_[first_block_[k]].offset;
    for (std::size_t i = 0; i < values.size(); ++i) {
      results[m][from + i] = values[i] + (correction_.empty() ? 0.0 : correction_[from + i]);
    }
  });
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

double squaresLeft(const TwinRunner& runner, const std::vector<double>& simulated) {
  double squares = 0.0;
  for (std::size_t i = 0; i < simulated.size(); ++i)
    squares += std::pow(runner.measured()[i] - simulated[i], 2);
  return squares;
}

}  // namespace smartmill::discrepancy
