// rosrun smartmill_studies kalman_endurance: an hour of samples through the estimator; memory and
// allocations.

#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <new>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/sorted_compensation.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace {

std::atomic<long long> live{0}, made{0};

}  // namespace

// Counts what the whole program asks for.
void* operator new(std::size_t size) {
  void* place = std::malloc(size > 0 ? size : 1);
  if (!place) throw std::bad_alloc();
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

/// [kB] resident.
long resident() {
  std::ifstream status("/proc/self/statm");
  long size = 0, pages = 0;
  status >> size >> pages;
  return pages * sysconf(_SC_PAGESIZE) / 1024;
}

}  // namespace

int main(int argc, char** argv) {
  double minutes = 60.0;
  CommandLine line{
      "Feeds an hour of samples (three axes, 25.6 kHz, with speed changes, gaps and cuts) through the node's "
      "estimator and prints its memory."};
  line.option("--minutes", minutes, "of data").showDefault().within(0.1, 1e5);
  return runProgram(line, argc, argv, [&] {
    ForceSensor sensor;
    for (ModalModel& axis : sensor.axis) axis = kalman::ReferenceCase::exactSensor();
    std::size_t blocks_out = 0;
    double sum = 0.0;
    kalman::SortedCompensation sorted({}, {}, sensor, 0.05,
                                      {[&](const ForceBlock&, const ForceBlock& c) {
                                         ++blocks_out;
                                         sum += c.force[0].back();
                                       },
                                       {},
                                       {},
                                       {}});
    SampleBlock block;
    block.sample_rate = 25600.0;
    block.channels = {"fx", "fy", "fz"};
    block.units = {"N", "N", "N"};
    block.samples.resize(3 * 256);
    const auto blocks = static_cast<long>(minutes * 6000.0);
    const auto begin = std::chrono::steady_clock::now();
    std::printf("%8s %10s %14s %18s\n", "minute", "RSS kB", "live objects", "allocations/block");
    long long made_before = made;
    long first = 0;
    std::uint64_t index = 0;
    double angle = 0.0;
    for (long b = 0; b <= blocks; ++b) {
      if (b % std::max(1L, blocks / 12) == 0) {
        const double span = static_cast<double>(std::max(1L, b - first));
        std::printf("%8.1f %10ld %14lld %18.1f\n", static_cast<double>(b) / 6000.0, resident(), live.load(),
                    static_cast<double>(made - made_before) / span);
        std::fflush(stdout);
        made_before = made;
        first = b;
      }
      // Every minute another of four speeds and a new cut; every five minutes a gap of the index.
      const long minute = b / 6000;
      const double speed = units::radPerSecFromRpm(6000.0 + 3000.0 * static_cast<double>(minute % 4));
      block.stamp = 0.01 * static_cast<double>(b);
      if (b % 6000 == 0) {
        CuttingCondition condition;
        condition.stamp = block.stamp;
        condition.kind = minute % 2 ? CuttingCondition::Kind::air : CuttingCondition::Kind::cut;
        sorted.push(condition);
      }
      if (b % 30000 == 29999) index += 1000;
      block.first_index = index;
      for (std::size_t i = 0; i < 256; ++i) {
        const double phase = 4.0 * (angle + speed * static_cast<double>(i) / block.sample_rate);
        const double force = 100.0 + 50.0 * std::cos(phase);
        block.samples[3 * i] = force;
        block.samples[3 * i + 1] = -0.5 * force;
        block.samples[3 * i + 2] = 0.2 * force;
      }
      sorted.push(SpindleAngle{block.stamp, angle, speed});
      sorted.push(block);
      angle = std::fmod(angle + 0.01 * speed, units::TWO_PI);
      index += 256;
    }
    sorted.flush();
    const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    std::printf("%zu blocks out, %.1f minutes of data in %.1f s, %.0f x real time%s\n", blocks_out, minutes,
                wall, 60.0 * minutes / wall, std::isfinite(sum) ? "" : ", NOT A NUMBER");
  });
}
