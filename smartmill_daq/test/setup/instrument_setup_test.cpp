// First connection of instruments whose device is a file with signals of closed form.

#include "smartmill_daq/setup/instrument_setup.h"

#include <chrono>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::daq {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using Method = CalibrationRequest::Method;

constexpr double RATE = 4000.0;  // [Hz]

double wallTime() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

template <class Kind = Error>
std::string refusalOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Kind& error) {
    return error.what();
  }
  return "";
}

class Setup : public ::testing::Test {
 protected:
  /// Volts of two inputs.
  void play(const std::function<double(double)>& first, const std::function<double(double)>& second,
            double seconds) const {
    std::string text = "one [V],two [V]\n";
    for (int i = 0; i < static_cast<int>(seconds * RATE); ++i)
      text += formatted("%.9f,%.9f\n", first(i / RATE), second(i / RATE));
    writeText(folder_.file("device.csv"), text);
  }
  static std::string description(const std::string& second = "sensitivity: 0.01") {
    return "format: smartmill-instrument/1\nname: bench\ndriver: file\noptions: {path: device.csv}\n"
           "sample_rate: 4000.0\nstreams:\n  - topic: daq/hammer\n    channels:\n"
           "      - {input: 1, name: hammer, unit: N, sensitivity: 0.02, range: 5.0}\n"
           "  - topic: daq/vibration\n    channels:\n      - {input: 2, name: x, unit: m/s2, " +
           second + ", range: 5.0, coupling: iepe}\n";
  }

  TemporaryFolder folder_;
  InstrumentSetup setup_{folder_.file(""), wallTime};
};

double sine(double time, double amplitude, double frequency) {
  return amplitude * std::sin(units::TWO_PI * frequency * time);
}

TEST_F(Setup, levelsAreThoseOfTheSignals) {
  play([](double t) { return 1.0 + sine(t, 0.5, 40.0); }, [](double t) { return sine(t, 6.0, 40.0); }, 1.5);
  const Trial trial = setup_.check(description(), 1.0);
  EXPECT_EQ(trial.problem, "");
  ASSERT_EQ(trial.channels.size(), 2u);
  const TriedChannel& hammer = trial.channels[0];
  EXPECT_EQ(hammer.topic, "daq/hammer");
  EXPECT_EQ(hammer.samples.size(), 4000u);
  // 0.02 V/N; 40 periods in the second.
  EXPECT_NEAR(hammer.mean, 50.0, 1e-6);
  EXPECT_NEAR(hammer.rms, 25.0 / std::sqrt(2.0), 1e-6);
  EXPECT_NEAR(hammer.peak, 1.5 / 5.0, 1e-6);
  EXPECT_EQ(hammer.clipped, 0u);
  // A sine of 6 V at a range of 5 V is beyond it for 2 acos(5 / 6) / pi = 0.373 of its period.
  EXPECT_NEAR(static_cast<double>(trial.channels[1].clipped), 0.373 * 4000.0, 0.01 * 4000.0);
  EXPECT_EQ(trial.channels[1].peak, 1.0);
  ASSERT_FALSE(trial.faults.empty());
  EXPECT_THAT(trial.faults[0], HasSubstr("clipping: x: clipped"));
}

TEST_F(Setup, theLineThatIsWrongIsNamed) {
  play([](double) { return 0.0; }, [](double) { return 0.0; }, 0.1);
  EXPECT_EQ(refusalOf([&] { setup_.check(description("sensitivity: 0"), 1.0); }),
            "instrument: streams[1].channels[0].sensitivity: 0, expected volts per m/s2");
  EXPECT_EQ(refusalOf([&] {
              setup_.check(description("sensitivity: 0.01, gain: 3"), 1.0);
            }).rfind("instrument: streams[1].channels[0].gain: ", 0),
            0u);
  std::string absent = description();
  absent.replace(absent.find("device.csv"), 10, "absent.csv");
  EXPECT_THAT(refusalOf([&] { setup_.check(absent, 1.0); }), HasSubstr("absent.csv"));
  EXPECT_EQ(refusalOf([&] { setup_.check(description(), 11.0); }), "seconds: 11, expected up to 10");
  // What was tried leaves nothing behind.
  EXPECT_TRUE(setup_.files().empty());
  EXPECT_THAT(refusalOf([&] { readText(folder_.file(".tried")); }), HasSubstr(".tried"));
}

TEST_F(Setup, aDeviceThatIsNotThereIsAProblemAndNoError) {
  const std::string text =
      "format: smartmill-instrument/1\nname: far\ndriver: tcp\noptions: {host: 127.0.0.1, port: 1}\n"
      "sample_rate: 4000.0\nstreams:\n  - topic: daq/vibration\n    channels:\n"
      "      - {input: 1, name: x, unit: m/s2, sensitivity: 0.01, range: 5.0}\n";
  const Trial trial = setup_.check(text, 0.2);
  EXPECT_THAT(trial.problem, HasSubstr("127.0.0.1"));
  EXPECT_TRUE(std::isnan(trial.channels[0].mean));
}

TEST_F(Setup, aFileIsWrittenOnceAndOnlyInTheFolder) {
  play([](double) { return 0.0; }, [](double) { return 0.0; }, 0.1);
  EXPECT_THAT(setup_.store(description(), "front_end", false), EndsWith("/front_end.yaml"));
  EXPECT_THAT(setup_.files(), ElementsAre("front_end"));
  EXPECT_EQ(readText(folder_.file("front_end.yaml")), description());
  EXPECT_THAT(refusalOf<NotWritten>([&] { setup_.store(description(), "front_end", false); }),
              HasSubstr("exists"));
  EXPECT_NO_THROW(setup_.store(description("sensitivity: 0.02"), "front_end", true));
  for (const char* const name : {"../front_end", "/tmp/front_end", "", "a b", "front_end.yaml"})
    EXPECT_THAT(refusalOf([&] { setup_.store(description(), name, true); }), HasSubstr("expected up to 60"))
        << name;
  EXPECT_THAT(refusalOf([&] { setup_.store(description("sensitivity: 0"), "second", false); }),
              HasSubstr("expected volts"));
  EXPECT_THAT(setup_.files(), ElementsAre("front_end"));
}

CalibrationRequest request(Method method, const std::string& topic, const std::string& channel) {
  CalibrationRequest request;
  request.file = "bench";
  request.topic = topic;
  request.channel = channel;
  request.method = method;
  request.seconds = 1.2;
  return request;
}

TEST_F(Setup, anExciterGivesTheSensitivityWhichIsStored) {
  // 10 m/s2 RMS at 0.0104 V/(m/s2), which the file states as 0.01.
  play([](double) { return 0.0; }, [](double t) { return sine(t, 0.104 * std::sqrt(2.0), 159.2); }, 1.3);
  setup_.store(description(), "bench", false);
  CalibrationRequest exciter = request(Method::exciter, "daq/vibration", "x");
  EXPECT_EQ(refusalOf([&] { setup_.calibrate(exciter); }), "exciter: expected its effective value, above 0");
  EXPECT_EQ(refusalOf([&] { setup_.storeResult("bench", "daq/vibration", "x", "2026-11-28"); }),
            "x: no result to store yet");
  exciter.exciter = 10.0;
  exciter.reference_std = 0.02;
  const auto found = setup_.calibrate(exciter);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->value, 0.0104, 0.0104 * 5e-4);
  EXPECT_NEAR(found->std_dev, 0.02 * 0.0104, 1e-5);  // that of the exciter
  setup_.storeResult("bench", "daq/vibration", "x", "2026-11-28");
  const Channel stored = readChannel(folder_.file("bench.yaml"), "daq/vibration", "x");
  EXPECT_NEAR(stored.sensitivity, 0.0104, 0.0104 * 5e-4);
  EXPECT_EQ(*stored.sensitivity_date, "2026-11-28");
  // A result is stored once.
  EXPECT_EQ(refusalOf([&] { setup_.storeResult("bench", "daq/vibration", "x", "2026-11-28"); }),
            "x: no result to store yet");
  // Another frequency than that of the exciter.
  exciter.frequency = 200.0;
  EXPECT_NE(refusalOf<UnsuitableRecord>([&] { setup_.calibrate(exciter); }), "");
}

TEST_F(Setup, aMassNeedsTheRecordWithoutIt) {
  const auto load = [this](double force) {
    // 0.0195 V/N, which the file states as 0.02, an offset, and a hum.
    play([force](double t) { return 0.3 + 0.0195 * force + sine(t, 0.001, 50.0); },
         [](double) { return 0.0; }, 1.3);
  };
  load(0.0);
  setup_.store(description(), "bench", false);
  CalibrationRequest mass = request(Method::mass, "daq/hammer", "hammer");
  mass.mass = 5.0;
  mass.against = true;
  EXPECT_EQ(refusalOf([&] { setup_.calibrate(mass); }),
            "method: the sensor was not recorded without the mass yet");
  EXPECT_FALSE(setup_.calibrate(request(Method::empty, "daq/hammer", "hammer")));
  load(-5.0 * 9.80665);
  const auto found = setup_.calibrate(mass);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->value, 0.0195, 2e-6);
}

TEST_F(Setup, hitsOnAMassUseTheAccelerometer) {
  const auto pulse = [](double t) {
    const double since = std::fmod(t, 0.25) - 0.1;
    return since > 0.0 && since < 4e-3 ? std::sin(units::PI * since / 4e-3) : 0.0;
  };
  // 100 N at 0.0216 V/N (stated: 0.02) on 1 kg: 100 m/s2 at 0.01 V/(m/s2); noise, since a constant channel
  // counts as stuck.
  play([&](double t) { return 2.16 * pulse(t); },
       [&](double t) { return 1.0 * pulse(t) + sine(t, 1e-4, 777.0); }, 1.3);
  setup_.store(description(), "bench", false);
  CalibrationRequest hits = request(Method::hits, "daq/hammer", "hammer");
  hits.mass = 1.0;
  EXPECT_EQ(refusalOf([&] { setup_.calibrate(hits); }), "accelerometer: expected TOPIC/CHANNEL");
  hits.accelerometer = "daq/vibration/x";
  const auto found = setup_.calibrate(hits);
  ASSERT_TRUE(found);
  EXPECT_GE(found->parts, 4u);
  EXPECT_NEAR(found->value, 0.0216, 1e-4);
}

}  // namespace
}  // namespace smartmill::daq
