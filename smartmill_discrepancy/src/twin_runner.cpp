#include "smartmill_discrepancy/twin_runner.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <thread>
#include <utility>

#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {

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
    first_block_.push_back(blocks_.size());
    for (const std::string& channel : test.channels) {
      const double noise = data_.noise.at(channel);
      blocks_.push_back({t, channel, size_, test.record.size(), noise});
      size_ += test.record.size();
      for (const double v : test.record.column(channel)) measured_.push_back(v / noise);
    }
  }
  first_block_.push_back(blocks_.size());
}

std::vector<std::vector<double>> TwinRunner::simulate(const std::vector<MachineModel>& models) const {
  std::vector<std::vector<double>> results(models.size(), std::vector<double>(size_));
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = substeps_;
  runParallel(models.size() * tests_.size(), threads_, [&](std::size_t job) {
    const std::size_t m = job / tests_.size(), k = job % tests_.size();
    const TestData& test = data_.tests[tests_[k]];
    const Record record = sim::simulateTest(models[m], test.test, test.record, options);
    for (std::size_t b = first_block_[k]; b < first_block_[k + 1]; ++b) {
      const Block& block = blocks_[b];
      const std::vector<double>& values = record.column(block.channel);
      for (std::size_t i = 0; i < block.size; ++i) results[m][block.offset + i] = values[i] / block.noise;
      if (correction_.empty()) continue;
      for (std::size_t i = block.offset; i < block.offset + block.size; ++i) results[m][i] += correction_[i];
    }
  });
  simulations_ += models.size() * tests_.size();
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

}  // namespace smartmill::discrepancy
