// Streams of two devices and of the controller whose shift is known.

#include "smartmill_daq/alignment/stream_alignment.h"

#include <cmath>
#include <functional>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/io/text_file.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_daq/instrument/instrument.h"

namespace smartmill::daq {
namespace {

using ::testing::HasSubstr;

constexpr double START = 1.8e9;  // [s]

/// A device that stamps its samples later by a delay.
class Device {
 public:
  Device(std::string topic, std::string channel, double rate, double delay, std::uint64_t seed)
      : topic_(std::move(topic)), channel_(std::move(channel)), rate_(rate), delay_(delay), random_(seed) {}

  /// Blocks of 10 ms up to a time [s]. @param value [unit] by the true time
  void run(double until, const std::function<double(double)>& value, double noise, StreamAlignment& to) {
    const auto samples = static_cast<std::uint64_t>(std::lround(0.01 * rate_));
    while (START + static_cast<double>(next_) / rate_ < until) {
      SampleBlock block;
      block.stamp = START + static_cast<double>(next_) / rate_ + delay_;
      block.sample_rate = rate_;
      block.first_index = next_;
      block.channels = {"other", channel_};
      block.units = {"N", "N"};
      for (std::uint64_t i = 0; i < samples; ++i) {
        block.samples.push_back(0.0);
        block.samples.push_back(value(START + static_cast<double>(next_ + i) / rate_) +
                                noise * normal_(random_));
      }
      next_ += samples;
      to.push(topic_, block);
    }
  }
  void lose(std::uint64_t samples) { next_ += samples; }
  void setDelay(double delay) { delay_ = delay; }

 private:
  std::string topic_, channel_;
  double rate_, delay_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::uint64_t next_ = 0;
};

double tap(double time) {
  // Not periodic: a period of taps would fit at several shifts.
  for (const double at : {1.3, 2.1, 3.7, 6.05, 8.9, 11.3, 14.1, 15.2, 17.9, 22.4, 25.1, 28.8}) {
    const double since = time - START - at;
    if (since > 0.0 && since < 1e-3) return 200.0 * std::sin(units::PI * since / 1e-3);
  }
  return 0.0;
}

TEST(StreamAlignment, TwoDevicesByTapsRecordByRecord) {
  Device hammer("daq/hammer", "hammer", 51200.0, 0.0043, 1), force("daq/dynamometer", "fz", 25600.0, 0.0, 2);
  StreamAlignment alignment(SignalName("daq/hammer/hammer"), SignalName("daq/dynamometer/fz"));
  for (double t = START; t < START + 21.0; t += 0.1) {
    hammer.run(t, tap, 0.5, alignment);
    force.run(t + 0.05, tap, 0.5, alignment);
  }
  EXPECT_EQ(alignment.records(), 2u);
  ASSERT_TRUE(alignment.state());
  EXPECT_EQ(alignment.state()->method, AlignmentMethod::taps);
  EXPECT_EQ(alignment.state()->shift.events, 9u);
  EXPECT_NEAR(alignment.state()->shift.delay, 0.0043, 3.0 * alignment.state()->shift.std_dev + 1e-6);
  EXPECT_LT(alignment.state()->shift.std_dev, 20e-6);
  EXPECT_THAT(alignmentText(alignment), HasSubstr("daq/hammer/hammer is 4.30"));
  EXPECT_THAT(alignmentText(alignment), HasSubstr("later than daq/dynamometer/fz, by taps (9)"));
}

TEST(StreamAlignment, AShiftThatChangesIsAnnouncedAndBeginsAnew) {
  Device hammer("daq/hammer", "hammer", 10000.0, 0.0043, 1), force("daq/dynamometer", "fz", 10000.0, 0.0, 2);
  StreamAlignment alignment(SignalName("daq/hammer/hammer"), SignalName("daq/dynamometer/fz"));
  for (double t = START; t < START + 31.0; t += 0.1) {
    if (t > START + 10.5) hammer.setDelay(0.0143);  // plugged in again
    hammer.run(t, tap, 0.5, alignment);
    force.run(t + 0.05, tap, 0.5, alignment);
  }
  EXPECT_THAT(alignment.takeChange(), HasSubstr("has changed from 4.3"));
  EXPECT_EQ(alignment.takeChange(), "");
  ASSERT_TRUE(alignment.state());
  EXPECT_NEAR(alignment.state()->shift.delay, 0.0143, 30e-6);
}

// A clock whose line wanders by 0.2 ms from record to record, where each record alone states microseconds.
TEST(StreamAlignment, TheScatterBetweenRecordsIsInTheStandardDeviation) {
  Device hammer("daq/hammer", "hammer", 10000.0, 0.0, 1), force("daq/dynamometer", "fz", 10000.0, 0.0, 2);
  StreamAlignment alignment(SignalName("daq/hammer/hammer"), SignalName("daq/dynamometer/fz"));
  for (double t = START; t < START + 31.0; t += 0.1) {
    hammer.setDelay(t < START + 10.2 ? 0.0041 : t < START + 20.4 ? 0.0043 : 0.0045);
    hammer.run(t, tap, 0.5, alignment);
    force.run(t + 0.05, tap, 0.5, alignment);
  }
  ASSERT_TRUE(alignment.state());
  EXPECT_EQ(alignment.takeChange(), "");
  // 0.2 ms between three records: about 0.2 ms / sqrt(3), by the weights that the records have.
  EXPECT_NEAR(alignment.state()->shift.delay, 0.0043, 2.0 * 0.2e-3 / std::sqrt(3.0));
  EXPECT_GT(alignment.state()->shift.std_dev, 0.04e-3);
  EXPECT_LT(alignment.state()->shift.std_dev, 0.25e-3);
}

TEST(StreamAlignment, GapsAndMissingSamplesAreNotBridged) {
  Device hammer("daq/hammer", "hammer", 10000.0, 0.002, 1), force("daq/dynamometer", "fz", 10000.0, 0.0, 2);
  StreamAlignment alignment(SignalName("daq/hammer/hammer"), SignalName("daq/dynamometer/fz"));
  for (double t = START; t < START + 29.0; t += 0.1) {
    if (std::abs(t - START - 5.0) < 0.05) force.lose(1234);
    hammer.run(t, tap, 0.5, alignment);
    force.run(t + 0.05, tap, 0.5, alignment);
  }
  ASSERT_TRUE(alignment.state());
  EXPECT_NEAR(alignment.state()->shift.delay, 0.002, 50e-6);
  EXPECT_EQ(alignment.takeChange(), "");
}

/// [m] One move of 40 mm within 0.3 s, begun 4 s after the start; smooth, with the acceleration in closed
/// form.
double phaseOf(double time) {
  return std::clamp((time - START - 4.0) / 0.3, 0.0, 1.0);
}
double positionOf(double time) {
  const double s = phaseOf(time);
  return 0.04 * (s - std::sin(units::TWO_PI * s) / units::TWO_PI);
}
double inertia(double time) {
  return -25.0 * 0.04 * units::TWO_PI / 0.09 * std::sin(units::TWO_PI * phaseOf(time));
}

TEST(StreamAlignment, ControllerByTheStartOfAnAxis) {
  for (const double delay : {0.188, -0.07}) {
    Device force("daq/dynamometer", "fx", 10000.0, delay, 3);
    StreamAlignment alignment(SignalName("daq/dynamometer/fx"), SignalName("cnc/state/x"));
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> jitter(0.0, 0.002);
    for (int i = 0; i < 600; ++i) {
      CncState state;
      state.connected = true;
      state.stamp = START + i / 50.0 + jitter(random);
      state.axes = {"Z", "X"};
      state.position = {0.3, positionOf(state.stamp)};
      alignment.push(state);
      force.run(state.stamp, inertia, 3.0, alignment);
    }
    ASSERT_TRUE(alignment.state()) << delay;
    EXPECT_EQ(alignment.state()->method, AlignmentMethod::motion);
    // A fiftieth of a second between two reports.
    EXPECT_NEAR(alignment.state()->shift.delay, delay, 3.0 * alignment.state()->shift.std_dev) << delay;
    EXPECT_LT(alignment.state()->shift.std_dev, 0.003);
  }
  EXPECT_THAT(errorOf([] { StreamAlignment(SignalName("cnc/state/x"), SignalName("daq/dynamometer/fx")); }),
              HasSubstr("expected as the second one"));
}

TEST(StreamAlignment, VibrationThatBothSeeByCorrelation) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> frequency(20.0, 400.0), phase(0.0, units::TWO_PI);
  std::vector<std::pair<double, double>> sines;
  for (int i = 0; i < 60; ++i) sines.emplace_back(frequency(random), phase(random));
  const auto vibration = [&](double time) {
    double sum = 0.0;
    for (const auto& [f, p] : sines) sum += std::sin(units::TWO_PI * f * (time - START) + p);
    return sum;
  };
  Device a("daq/vibration", "x", 2000.0, 0.031, 1), b("daq/dynamometer", "fx", 2500.0, 0.0, 2);
  StreamAlignment alignment(SignalName("daq/vibration/x"), SignalName("daq/dynamometer/fx"));
  for (double t = START; t < START + 11.0; t += 0.1) {
    a.run(t, vibration, 2.0, alignment);
    b.run(t + 0.05, vibration, 2.0, alignment);
  }
  ASSERT_TRUE(alignment.state());
  EXPECT_EQ(alignment.state()->method, AlignmentMethod::correlation);
  EXPECT_NEAR(alignment.state()->shift.delay, 0.031, 3.0 * alignment.state()->shift.std_dev);
}

TEST(StreamAlignment, TheLatencyIsStoredAndTheRestOfTheFileStays) {
  const TemporaryFolder folder;
  const std::string text =
      "# front end\nformat: smartmill-instrument/1\nname: front end\ndriver: tcp\n"
      "options: {host: 127.0.0.1, port: 5045}\nsample_rate: 51200.0   # [Hz]\nstreams:\n"
      "  - topic: daq/vibration\n    channels:\n"
      "      - {input: 1, name: x, unit: m/s2, sensitivity: 0.0102, range: 5.0}\n";
  const std::string file = folder.write("instrument.yaml", text);
  EXPECT_NEAR(storeLatency(file, {0.0125, 3e-5, 1.0, 4}), 0.0125, 1e-9);
  std::optional<StrictYaml> options;
  EXPECT_NEAR(readInstrument(file, &options).latency, 0.0125, 1e-9);
  EXPECT_NEAR(readInstrument(file, &options).latency_std, 3e-5, 1e-9);
  // What remains is added to what the file states already.
  EXPECT_NEAR(storeLatency(file, {-0.0005, 2e-5, 1.0, 4}), 0.012, 1e-9);
  EXPECT_NEAR(readInstrument(file, &options).latency_std, 2e-5, 1e-9);
  EXPECT_THAT(readText(file), HasSubstr("   # [Hz]\n"));
  EXPECT_THAT(errorOf([&] {
                storeLatency(file, {-0.5, 2e-5, 1.0, 4});
              }),
              HasSubstr("the other stream is the late one"));
}

}  // namespace
}  // namespace smartmill::daq
