// rosrun smartmill_studies kalman_latency: latency of three axes at 50 kHz in 10 ms blocks with all cores
// loaded.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace {

using namespace smartmill;
using Clock = std::chrono::steady_clock;

constexpr double RATE = 50000.0;                 // [Hz]
constexpr std::size_t BLOCK = 500;               // 10 ms
constexpr double SPEED = units::TWO_PI * 150.0;  // 9000 rpm: 33 harmonics up to 5 kHz
constexpr int STATES = 6 + 1 + 2 * 33;

struct Took {
  std::vector<double> work,
      delay;  // [us] duration of the call; delay from the nominal time of the block to its output
};

void print(const char* name, Took took) {
  const auto at = [](std::vector<double>& v, double share) {
    std::sort(v.begin(), v.end());
    return v[std::min(v.size() - 1, static_cast<std::size_t>(share * static_cast<double>(v.size())))];
  };
  std::printf(
      "%-34s  in to out: median %8.1f  99 %% %8.1f  max %8.1f us   from nominal time: median %8.1f  99 %% "
      "%8.1f us\n",
      name, at(took.work, 0.5), at(took.work, 0.99), at(took.work, 1.0), at(took.delay, 0.5),
      at(took.delay, 0.99));
}

SampleBlock blockOf(std::uint64_t number) {
  SampleBlock block;
  block.stamp = 0.01 * static_cast<double>(number);
  block.sample_rate = RATE;
  block.first_index = number * BLOCK;
  block.channels = {"fx", "fy", "fz"};
  block.units = {"N", "N", "N"};
  for (std::size_t i = 0; i < BLOCK; ++i) {
    const double phase = SPEED * static_cast<double>(block.first_index + i) / RATE;
    const double force = 100.0 + 50.0 * std::cos(4.0 * phase) + 20.0 * std::sin(8.0 * phase);
    block.samples.insert(block.samples.end(), {force, -0.5 * force, 0.2 * force});
  }
  return block;
}

/// A block every 10 ms, as from a device.
template <typename Handle>
Took run(int blocks, Handle handle) {
  Took took;
  handle(blockOf(0));  // computes the design
  const auto start = Clock::now() + std::chrono::milliseconds(10);
  for (int b = 1; b <= blocks; ++b) {
    const SampleBlock block = blockOf(static_cast<std::uint64_t>(b));
    const auto nominal = start + b * std::chrono::milliseconds(10);
    std::this_thread::sleep_until(nominal);
    const auto begin = Clock::now();
    handle(block);
    const auto end = Clock::now();
    took.work.push_back(1e6 * std::chrono::duration<double>(end - begin).count());
    took.delay.push_back(1e6 * std::chrono::duration<double>(end - nominal).count());
  }
  return took;
}

/// Threads that keep cores busy during its lifetime.
class Load {
 public:
  explicit Load(int threads) {
    for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
  }
  ~Load() {
    stop_ = true;
    for (std::thread& thread : threads_) thread.join();
  }
  Load(const Load&) = delete;
  Load& operator=(const Load&) = delete;

 private:
  void work() {
    double x = 1.0;
    while (!stop_.load(std::memory_order_relaxed)) {
      for (int k = 0; k < 1000; ++k) x = std::sqrt(x + 1.0);
    }
    if (x < 0.0) std::printf("%f", x);
  }
  std::atomic<bool> stop_{false};
  std::vector<std::thread> threads_;
};

Took runEstimator(int blocks, double& sum) {
  std::size_t out = 0;
  kalman::ForceCompensation estimator({}, false, {{}, [&](const ForceBlock& compensated) {
                                                    ++out;
                                                    sum += compensated.force[0].back();
                                                  }});
  for (std::size_t axis = 0; axis < 3; ++axis) estimator.setSensor(axis, ReferenceCase::exactSensor());
  const Took took = run(blocks, [&](const SampleBlock& block) {
    estimator.handle(SpindleAngle{block.stamp, SPEED * block.stamp, SPEED});
    estimator.handle(block);
  });
  if (out != static_cast<std::size_t>(blocks) + 1) throw Error("blocks were lost");
  return took;
}

Took runDense(int blocks, double& sum) {
  using Matrix = Eigen::Matrix<double, STATES, STATES>;
  using Vector = Eigen::Matrix<double, STATES, 1>;
  struct Dense {
    Matrix transition = 0.02 * Matrix::Random();  // the values have no influence on the cost
    Vector gain = 0.1 * Vector::Random(), output = Vector::Random(), force = Vector::Random(),
           x = Vector::Zero();
  };
  std::vector<Dense> dense(3);
  return run(blocks, [&](const SampleBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        Dense& d = dense[axis];
        const Vector filtered = d.x + d.gain * (block.at(i, axis) - d.output.dot(d.x));
        sum += d.force.dot(filtered);
        d.x.noalias() = d.transition * filtered;
      }
    }
  });
}

void compare(double seconds, int loads) {
  const int blocks = static_cast<int>(100.0 * seconds);
  double sum = 0.0;
  Took own, baseline;
  {
    const Load load(loads);
    own = runEstimator(blocks, sum);
    baseline = runDense(blocks, sum);
  }
  std::printf(
      "%d blocks of 10 ms, 3 axes at 50 kHz, 3 modes and 33 harmonics, %d busy threads on %u cores (%.0f)\n",
      blocks, loads, std::thread::hardware_concurrency(), std::isfinite(sum) ? 0.0 : 1.0);
  print("ForceCompensation", own);
  print("dense fixed-size Eigen (baseline)", baseline);
}

}  // namespace

int main(int argc, char** argv) {
  double seconds = 10.0;
  int loads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  CommandLine line{
      "Latency of three axes at 50 kHz in 10 ms blocks with every core busy; baseline: the same filters as "
      "dense fixed-size products."};
  line.option("--seconds", seconds, "of each run").showDefault().within(0.1, 1000.0);
  line.option("--loads", loads, "number of busy threads").showDefault().within(0, 256);
  return runProgram(line, argc, argv, [&] { compare(seconds, loads); });
}
