#include "smartmill_discrepancy/gap/twin_runner.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <thread>
#include <utility>

namespace smartmill::discrepancy {

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
    : data_(data), tests_(std::move(tests)), threads_(threads), channels_(data, tests_) {
  settings_.substeps = substeps;
  for (std::size_t k = 0; k < tests_.size(); ++k)
    twins_.emplace_back(data.tests[tests_[k]], channels_, k, substeps);
  readPhases();
  readGuidance();
}

void TwinRunner::readPhases() {
  for (TestTwin& twin : twins_) twin.readPhase();
}

void TwinRunner::readGuidance() {
  for (std::size_t k = 0; k < twins_.size(); ++k) {
    const bool changed = twins_[k].readGuidance();
    if (!channels_.readWeights(k) && !changed) continue;
    correction_.clear();
    twins_[k].clear();
  }
  channels_.whitenRecords();
}

void TwinRunner::set(const TwinSettings& settings) {
  const bool same_fineness =
      settings.substeps == settings_.substeps && settings.corner_slices == settings_.corner_slices;
  if (same_fineness && settings.guided == settings_.guided) return;
  settings_ = settings;
  correction_.clear();
  for (TestTwin& twin : twins_) {
    if (same_fineness) {
      twin.clear();
    } else {
      twin.restart(settings.substeps);
    }
  }
}

void TwinRunner::setWhitening(std::vector<Whitening> of_spans) {
  if (!channels_.setWhitening(std::move(of_spans))) return;
  correction_.clear();
  for (TestTwin& twin : twins_) twin.clearChannels();
}

SimulatedChannels TwinRunner::realigned(const MachineModel& model, const SimulatedChannels& base,
                                        std::size_t chosen, const RecordAlignment& by) const {
  SimulatedChannels of_test = twins_[chosen].realigned(model, settings_, by), all = base;
  ++simulations_;
  std::move(of_test.begin(), of_test.end(),
            all.begin() + static_cast<std::ptrdiff_t>(channels_.begin(chosen)));
  return all;
}

std::vector<SimulatedChannels> TwinRunner::simulateChannels(const std::vector<MachineModel>& models) const {
  std::vector<SimulatedChannels> results(models.size(), SimulatedChannels(spans().size()));
  runParallel(models.size() * tests_.size(), threads_, [&](std::size_t job) {
    const std::size_t k = job / models.size(), m = job % models.size();
    SimulatedChannels of_test = twins_[k].simulate(models[m], settings_, &simulations_);
    std::move(of_test.begin(), of_test.end(),
              results[m].begin() + static_cast<std::ptrdiff_t>(channels_.begin(k)));
  });
  return results;
}

std::vector<double> TwinRunner::joined(const SimulatedChannels& simulated) const {
  std::vector<double> all;
  all.reserve(size());
  for (const auto& span : simulated) all.insert(all.end(), span->begin(), span->end());
  for (std::size_t i = 0; i < correction_.size(); ++i) all[i] += correction_[i];
  return all;
}

void TwinRunner::compare(const SimulatedChannels& simulated, std::size_t span, double* difference) const {
  const ChannelSpan& b = spans()[span];
  const std::vector<double>&values = *simulated[span], &records = measured();
  for (std::size_t i = 0; i < b.size; ++i) difference[i] = values[i] - records[b.offset + i];
  for (std::size_t i = 0; i < b.size && !correction_.empty(); ++i) difference[i] += correction_[b.offset + i];
}

std::vector<double> TwinRunner::simulate(const MachineModel& model) const {
  return joined(simulateChannels({model}).front());
}

void TwinRunner::correctTo(const MachineModel& reference, const std::vector<double>& exact) {
  correction_.clear();
  const std::vector<double> mine = simulate(reference);
  correction_.resize(size());
  for (std::size_t i = 0; i < size(); ++i) correction_[i] = exact[i] - mine[i];
}

std::vector<std::vector<double>> simulateAll(const TwinRunner& runner,
                                             const std::vector<MachineModel>& models) {
  std::vector<std::vector<double>> results;
  for (const SimulatedChannels& simulated : runner.simulateChannels(models))
    results.push_back(runner.joined(simulated));
  return results;
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
