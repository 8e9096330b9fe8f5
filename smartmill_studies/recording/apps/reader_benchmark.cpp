// Time to read a session: decodes every message of a recording of 473 MB with the reader of this project and
// with that of ROS (rosbag::View). 473 MB and 6128 messages are the size of the bag with which embag's
// authors compare readers (3.3 s in C++, lz4; github.com/embarktrucks/embag). The file is in the page cache.

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <random>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <smartmill_msgs/SampleBlock.h>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_recording/recording_reader.h"
#include "smartmill_recording/recording_writer.h"

namespace {

using namespace smartmill;

constexpr std::uint64_t FILE_SIZE = 473000000;  // [byte]
constexpr std::size_t MESSAGES = 6128;
constexpr std::uint64_t PERIOD = 10000000;  // [ns] between messages
constexpr double RESOLUTION = 0.03;         // [N] of a converter

/// A block of a force sensor with three channels: a cut in steps of a converter.
SampleBlock blockOf(std::size_t number, std::size_t samples, std::mt19937& random) {
  std::normal_distribution<double> noise(0.0, 1.0);
  SampleBlock block;
  block.stamp = 1e-9 * static_cast<double>(PERIOD * number);
  block.sample_rate = 1e9 / static_cast<double>(PERIOD) * static_cast<double>(samples);
  block.first_index = number * samples;
  block.channels = {"fx", "fy", "fz"};
  block.units = {"N", "N", "N"};
  for (std::size_t i = 0; i < samples; ++i) {
    for (const double amplitude : {100.0, 150.0, 30.0}) {
      const double force = amplitude * std::sin(0.05 * static_cast<double>(i)) + noise(random);
      block.samples.push_back(RESOLUTION * std::round(force / RESOLUTION));
    }
  }
  return block;
}

/// [byte] size of a file with a number of messages
std::uint64_t write(const std::string& path, RecordingCompression compression, std::size_t messages,
                    std::size_t samples) {
  // A few blocks in turn, to save simulation time.
  constexpr std::size_t DIFFERENT = 50;
  std::mt19937 random(1);
  std::vector<SampleBlock> blocks;
  for (std::size_t i = 0; i < DIFFERENT; ++i) blocks.push_back(blockOf(i, samples, random));
  const auto writer = createRecording(path, compression);
  for (std::size_t i = 0; i < messages; ++i)
    writer->write(names::DYNAMOMETER, PERIOD * (i + 1), blocks[i % DIFFERENT]);
  writer->close();
  return std::filesystem::file_size(path);
}

/// The recording for a file extension and a compression; made at the first call.
const std::string& recording(const std::string& ending, RecordingCompression compression) {
  static const TemporaryFolder FOLDER;
  static std::map<std::pair<std::string, RecordingCompression>, std::string> made;
  std::string& path = made[{ending, compression}];
  if (!path.empty()) return path;
  path = FOLDER.file("session" + std::to_string(made.size()) + ending);
  // The number of samples per block gives the compressed file its size.
  constexpr std::size_t FEW = 200, TRIAL = 3000;
  const std::uint64_t trial = write(path, compression, FEW, TRIAL);
  const double byte_each = static_cast<double>(trial) / FEW / TRIAL;
  write(path, compression, MESSAGES,
        static_cast<std::size_t>(static_cast<double>(FILE_SIZE) / MESSAGES / byte_each));
  return path;
}

/// @param samples decoded samples of all channels
void counters(benchmark::State& state, const std::string& path, std::size_t messages, std::size_t samples) {
  const auto size = static_cast<double>(std::filesystem::file_size(path));
  state.counters["file_MB"] = size / 1e6;
  state.counters["messages"] = static_cast<double>(messages);
  state.counters["samples_MB"] = 1e-6 * static_cast<double>(samples * sizeof(double));
  state.counters["MB_per_s"] =
      benchmark::Counter(size / 1e6 * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}

/// This project's reader; blocks become those of the core.
void smartmillReader(benchmark::State& state, const std::string& ending, RecordingCompression compression) {
  const std::string path = recording(ending, compression);
  std::size_t messages = 0, samples = 0;
  for (auto _ : state) {
    messages = samples = 0;
    double sum = 0.0;
    RecordingReader reader(path);
    reader.on<SampleBlock>(names::DYNAMOMETER, [&](const SampleBlock& block, double) {
      ++messages;
      samples += block.samples.size();
      sum += block.samples.back();
    });
    reader.run();
    benchmark::DoNotOptimize(sum);
  }
  counters(state, path, messages, samples);
}

/// The reader of ROS; blocks become messages.
void rosbagView(benchmark::State& state, RecordingCompression compression) {
  const std::string path = recording(".bag", compression);
  std::size_t messages = 0, samples = 0;
  for (auto _ : state) {
    messages = samples = 0;
    double sum = 0.0;
    rosbag::Bag bag(path, rosbag::bagmode::Read);
    for (const rosbag::MessageInstance& message : rosbag::View(bag)) {
      const auto block = message.instantiate<smartmill_msgs::SampleBlock>();
      ++messages;
      samples += block->samples.size();
      sum += block->samples.back();
    }
    benchmark::DoNotOptimize(sum);
  }
  counters(state, path, messages, samples);
}

constexpr int REPEATS = 3;

#define READS(function, name, ...)               \
  BENCHMARK_CAPTURE(function, name, __VA_ARGS__) \
      ->Unit(benchmark::kMillisecond)            \
      ->UseRealTime()                            \
      ->MeasureProcessCPUTime()                  \
      ->Iterations(1)                            \
      ->Repetitions(REPEATS)                     \
      ->ReportAggregatesOnly()
READS(smartmillReader, bag_none, ".bag", RecordingCompression::none);
READS(rosbagView, bag_none, RecordingCompression::none);
READS(smartmillReader, bag_lz4, ".bag", RecordingCompression::lz4);
READS(rosbagView, bag_lz4, RecordingCompression::lz4);
READS(smartmillReader, mcap_none, ".mcap", RecordingCompression::none);
READS(smartmillReader, mcap_lz4, ".mcap", RecordingCompression::lz4);
READS(smartmillReader, mcap_zstd, ".mcap", RecordingCompression::zstd);

}  // namespace

BENCHMARK_MAIN();
