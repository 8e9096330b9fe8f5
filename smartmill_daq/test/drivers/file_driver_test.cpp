#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/sound_file.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_daq/acquisition/acquisition.h"
#include "smartmill_recording/recording_writer.h"

namespace smartmill::daq {
namespace {

using ::testing::HasSubstr;

constexpr double RATE = 2000.0;
constexpr int SAMPLES = 400;  // 0.2 s

std::string place(const std::string& name) {
  static const TemporaryFolder folder;
  return folder.file(name);
}

double force(int i) {
  return 0.5 * std::sin(0.1 * i) + 0.001 * i;
}

double wallTime() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

struct Played {
  std::vector<double> values;
  std::uint64_t lost = 0;
  double seconds = 0.0;
  std::string faults;
};

/// Plays a file through the acquisition.
Played play(const std::string& options, const std::string& channel = "input: 1") {
  const std::string file = place("instrument.yaml");
  writeText(file, "format: smartmill-instrument/1\nname: file\ndriver: file\noptions: {" + options + "}\n" +
                      formatted("sample_rate: %.1f\n", RATE) +
                      "streams:\n  - topic: daq/dynamometer\n    channels:\n      - {" + channel +
                      ", name: fx, unit: N, sensitivity: 1.0, range: 1000.0}\n");
  std::optional<StrictYaml> read;
  const Instrument instrument = readInstrument(file, &read);
  Played played;
  Acquisition::Outputs outputs;
  outputs.block = [&](const Stream&, const SampleBlock& block) {
    played.values.insert(played.values.end(), block.samples.begin(), block.samples.end());
  };
  outputs.fault = [&](const Fault& fault) { played.faults += fault.text + "\n"; };
  Acquisition acquisition(instrument, makeDriver(file, instrument, read), outputs, wallTime);
  const double begin = wallTime();
  while (acquisition.step()) {
  }
  played.seconds = wallTime() - begin;
  played.lost = acquisition.state().account.lost;
  return played;
}

void expectForces(const Played& played, double tolerance, double factor = 1.0) {
  ASSERT_EQ(played.values.size(), static_cast<std::size_t>(SAMPLES)) << played.faults;
  for (int i = 0; i < SAMPLES; ++i)
    ASSERT_NEAR(played.values[static_cast<std::size_t>(i)], factor * force(i), tolerance) << i;
  EXPECT_GT(played.seconds, 0.99 * SAMPLES / RATE);  // not faster than it was taken
}

TEST(FileDriver, playsDynoWareTextInNewton) {
  std::string text = "DynoWare Version 2.4\nSampling rate [Hz]: 2000\nTime\tFx\tFy\ns\tkN\tkN\n";
  for (int i = 0; i < SAMPLES; ++i) text += formatted("%.6f\t%.9f\t%.9f\n", i / RATE, force(i), 0.0);
  writeText(place("cut.txt"), text);
  expectForces(play("path: cut.txt", "input: Fx"), 1e-5, 1000.0);
}

TEST(FileDriver, playsSoundAsShareOfTheRange) {
  SoundFile sound{RATE, {std::vector<double>(SAMPLES)}};
  for (int i = 0; i < SAMPLES; ++i) sound.channels[0][static_cast<std::size_t>(i)] = force(i);
  writeWav(sound, place("cut.wav"));
  expectForces(play("path: cut.wav"), 2000.0 * std::pow(2.0, -23), 1000.0);
}

TEST(FileDriver, aRecordingsGapStaysAGap) {
  {
    const auto writer = createRecording(place("cut.bag"), RecordingCompression::none);
    for (int b = 0; b < 4; ++b) {
      SampleBlock block;
      block.stamp = 1000.0 + b;
      block.sample_rate = RATE;
      block.first_index = static_cast<std::uint64_t>(5000 + 100 * b + (b > 1 ? 30 : 0));
      block.channels = {"x", "fx"};
      block.units = {"N", "N"};
      for (int i = 0; i < 100; ++i) block.samples.insert(block.samples.end(), {0.0, force(100 * b + i)});
      writer->write("daq/dynamometer", 1000000000u * static_cast<unsigned>(b + 1), toPlain(block));
    }
    writer->close();
  }
  const Played played = play("path: cut.bag, topic: daq/dynamometer", "input: fx");
  expectForces(played, 0.0);
  EXPECT_EQ(played.lost, 30u);
  EXPECT_THAT(played.faults, HasSubstr("30 samples are missing"));
}

TEST(FileDriver, aFileOfAnotherRateIsAnnounced) {
  std::string text = "time[s],fx[N]\n";
  for (int i = 0; i < SAMPLES; ++i) text += formatted("%.6f,%.9f\n", i / 2500.0, force(i));
  writeText(place("cut.csv"), text);
  const Played played = play("path: cut.csv", "input: 2");
  EXPECT_TRUE(played.values.empty());
  EXPECT_THAT(played.faults, HasSubstr("2500 samples per second, expected 2000"));
}

TEST(FileDriver, readsAPipeLineByLine) {
  const std::string pipe = place("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::thread writer([&pipe] {
    std::ofstream out(pipe);
    out << "Fx;Fy\n";
    for (int i = 0; i < SAMPLES; ++i) out << formatted("%.9f;%.9f\n", force(i), 0.0);
  });
  const std::string file = place("pipe.yaml");
  writeText(
      file,
      "format: smartmill-instrument/1\nname: pipe\ndriver: file\noptions: {path: pipe}\nsample_rate: 2000.0\n"
      "streams:\n  - topic: daq/dynamometer\n    channels:\n"
      "      - {input: Fx, name: fx, unit: N, sensitivity: 1.0, range: 1000.0}\n");
  std::optional<StrictYaml> options;
  const Instrument instrument = readInstrument(file, &options);
  const auto driver = makeDriver(file, instrument, options);
  driver->open();
  std::vector<double> values;
  std::string end;
  while (end.empty()) {
    RawBatch batch;
    try {
      if (driver->read(&batch, 0.05)) values.insert(values.end(), batch.values.begin(), batch.values.end());
    } catch (const DeviceLost& lost) {
      end = lost.what();
    }
  }
  writer.join();
  EXPECT_THAT(end, HasSubstr("its writer has closed it"));
  ASSERT_EQ(values.size(), static_cast<std::size_t>(SAMPLES));
  for (int i = 0; i < SAMPLES; ++i) EXPECT_NEAR(values[static_cast<std::size_t>(i)], force(i), 1e-9);
}

}  // namespace
}  // namespace smartmill::daq
