// rosrun smartmill_studies kalman_endurance: memory and allocations of the estimator over an hour of samples.

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/io/process_usage.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace {

std::atomic<long long> live{0}, made{0};

}  // namespace

// Counts all allocations of the program. The compiler inlines these operators and reports a mismatch of
// malloc and delete.
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"
void* operator new(std::size_t size) {
  void* place = std::malloc(size > 0 ? size : 1);
  if (!place) throw std::bad_alloc();
  ++live;
  ++made;
  return place;
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  void* place = std::malloc(size > 0 ? size : 1);
  if (!place) return nullptr;
  ++live;
  ++made;
  return place;
}
void operator delete(void* place) noexcept {
  if (place) --live;
  std::free(place);
}
void operator delete(void* place, std::size_t) noexcept {
  operator delete(place);
}

namespace {

using namespace smartmill;

constexpr std::size_t BLOCK = 256;  // 10 ms
constexpr long BLOCKS_PER_MINUTE = 6000;

/// Three axes at 25.6 kHz. The speed changes every minute, between four values, with a new cut; every five
/// minutes the sample index has a gap.
class Machine {
 public:
  Machine() {
    block_.sample_rate = 25600.0;
    block_.channels = {"fx", "fy", "fz"};
    block_.units = {"N", "N", "N"};
    block_.samples.resize(3 * BLOCK);
  }

  void feed(kalman::CompensationPipeline& sorted, long number) {
    const long minute = number / BLOCKS_PER_MINUTE;
    const double speed = units::radPerSecFromRpm(6000.0 + 3000.0 * static_cast<double>(minute % 4));
    block_.stamp = 0.01 * static_cast<double>(number);
    if (number % BLOCKS_PER_MINUTE == 0) {
      CuttingCondition condition;
      condition.stamp = block_.stamp;
      condition.kind = minute % 2 ? CuttingCondition::Kind::air : CuttingCondition::Kind::cut;
      sorted.push(condition);
    }
    if (number % (5 * BLOCKS_PER_MINUTE) == 5 * BLOCKS_PER_MINUTE - 1) block_.first_index += 1000;
    for (std::size_t i = 0; i < BLOCK; ++i) {
      const double phase = 4.0 * (angle_ + speed * static_cast<double>(i) / block_.sample_rate);
      const double force = 100.0 + 50.0 * std::cos(phase);
      block_.samples[3 * i] = force;
      block_.samples[3 * i + 1] = -0.5 * force;
      block_.samples[3 * i + 2] = 0.2 * force;
    }
    sorted.push(SpindleAngle{block_.stamp, angle_, speed});
    sorted.push(block_);
    angle_ = std::fmod(angle_ + 0.01 * speed, units::TWO_PI);
    block_.first_index += BLOCK;
  }

 private:
  SampleBlock block_;
  double angle_ = 0.0;  // [rad]
};

/// A row every twelfth of the duration: memory, and allocations since the last row.
class Account {
 public:
  explicit Account(long blocks) : every_(std::max(1L, blocks / 12)) {
    std::printf("%8s %10s %14s %18s\n", "minute", "RSS kB", "live objects", "allocations/block");
  }
  void at(long number) {
    if (number % every_ != 0) return;
    const double span = static_cast<double>(std::max(1L, number - first_));
    std::printf("%8.1f %10ld %14lld %18.1f\n", static_cast<double>(number) / BLOCKS_PER_MINUTE,
                static_cast<long>(processUsage().memory / 1024.0), live.load(),
                static_cast<double>(made - made_before_) / span);
    std::fflush(stdout);
    made_before_ = made;
    first_ = number;
  }

 private:
  long every_, first_ = 0;
  long long made_before_ = made;
};

void run(double minutes) {
  ForceSensor sensor;
  for (ModalModel& axis : sensor.axis) axis = ReferenceCase::exactSensor();
  std::size_t blocks_out = 0;
  double sum = 0.0;
  const auto receive = [&](const ForceBlock& compensated) {
    ++blocks_out;
    sum += compensated.force[0].back();
  };
  kalman::CompensationPipeline sorted({}, {}, sensor, 0.05, {{{}, receive}});
  const auto blocks = static_cast<long>(minutes * BLOCKS_PER_MINUTE);
  const auto begin = std::chrono::steady_clock::now();
  Machine machine;
  Account account(blocks);
  for (long b = 0; b <= blocks; ++b) {
    account.at(b);
    machine.feed(sorted, b);
  }
  sorted.flush();
  const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::printf("%zu blocks out, %.1f minutes of data in %.1f s, %.0f x real time%s\n", blocks_out, minutes,
              wall, 60.0 * minutes / wall, std::isfinite(sum) ? "" : ", NOT A NUMBER");
}

}  // namespace

int main(int argc, char** argv) {
  double minutes = 60.0;
  CommandLine line{
      "Feeds an hour of samples (three axes, 25.6 kHz, with speed changes, gaps and cuts) through the node's "
      "estimator and prints its memory."};
  line.option("--minutes", minutes, "of data").showDefault().within(0.1, 1e5);
  return runProgram(line, argc, argv, [&] { run(minutes); });
}
