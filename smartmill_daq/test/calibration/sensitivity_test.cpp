// Sensors of known sensitivity: signals made here by closed forms, read with a sensitivity that is off.

#include "smartmill_daq/calibration/sensitivity.h"

#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_daq/instrument/instrument.h"

namespace smartmill::daq {
namespace {

using testing::HasSubstr;

constexpr double RATE = 48000.0;  // [Hz]

std::string messageOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// @param read [1] value read over the true one
std::vector<double> exciter(double read, double frequency, double noise, std::uint64_t seed,
                            double rate = RATE) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> samples;
  for (std::size_t i = 0; i < static_cast<std::size_t>(3.0 * rate); ++i) {
    const double angle = units::TWO_PI * frequency * static_cast<double>(i) / rate;
    samples.push_back(read * (10.0 * std::sqrt(2.0) * std::sin(angle) + noise * normal(random)) + 0.3);
  }
  return samples;
}

TEST(Sensitivity, ExciterWhoseFrequencyIsOff) {
  for (const double frequency : {157.0, 159.155, 161.8}) {
    const ReadingRatio ratio = ratioByExciter(exciter(1.04, frequency, 0.2, 1), RATE, 159.155, 10.0);
    EXPECT_NEAR(ratio.value, 1.04, 5e-4) << frequency;
    EXPECT_EQ(ratio.parts, 9u);
  }
}

TEST(Sensitivity, ExciterStatesItsScatter) {
  constexpr double SLOW = 4800.0;  // [Hz]
  Coverage coverage;
  for (int draw = 0; draw < Coverage::RUNS; ++draw) {
    const ReadingRatio ratio = ratioByExciter(
        exciter(0.97, 159.155, 0.5, 100u + static_cast<unsigned>(draw), SLOW), SLOW, 159.155, 10.0);
    coverage.add(ratio.value - 0.97, ratio.std_dev);
  }
  EXPECT_TRUE(coverage.isCalibrated());
}

TEST(Sensitivity, WhatIsNoSineOrTooShortIsRefused) {
  std::vector<double> other = exciter(1.0, 300.0, 0.0, 1);
  EXPECT_THAT(messageOf([&] { ratioByExciter(other, RATE, 159.155, 10.0); }),
              HasSubstr("is no sine of 159.2 Hz"));
  other.resize(30000);
  EXPECT_THAT(messageOf([&] { ratioByExciter(other, RATE, 159.155, 10.0); }),
              HasSubstr("record of 0.62 s: expected 0.94 s or more"));
  other[7] = std::nan("");
  EXPECT_EQ(messageOf([&] { ratioByExciter(other, RATE, 159.155, 10.0); }), "sample 7: not a finite number");
}

TEST(Sensitivity, ForceSensorUnderAMass) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, 0.5);
  const double weight = 10.0 * 9.80665;
  std::vector<double> empty(800), loaded(800);
  Coverage coverage;
  for (int draw = 0; draw < Coverage::RUNS; ++draw) {
    for (double& force : empty) force = -3.0 + noise(random);
    for (double& force : loaded) force = -3.0 - 0.95 * weight + noise(random);  // turned sensor, 5 % low
    const ReadingRatio ratio = ratioByMass(empty, loaded, weight);
    coverage.add(ratio.value + 0.95, ratio.std_dev);
  }
  EXPECT_TRUE(coverage.isCalibrated());
  EXPECT_THAT(messageOf([&] { ratioByMass(empty, empty, weight); }),
              HasSubstr("expected more than 5 standard deviations"));
}

std::vector<double> hits(double amplitude, double period, double noise, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> samples;
  for (int hit = 0; hit < 5; ++hit) {
    for (int i = 0; i < 12000; ++i) {
      const double t = (i - 4000) / RATE;
      const double pulse = t > 0.0 && t < period ? std::sin(units::PI * t / period) : 0.0;
      samples.push_back(amplitude * (1.0 + 0.1 * hit) * pulse + noise * normal(random));
    }
  }
  return samples;
}

TEST(Sensitivity, HammerOnAHangingMass) {
  const double mass = 1.02, peak = 200.0;
  const ReadingRatio ratio =
      ratioByHits(hits(0.9 * peak, 1e-3, 0.3, 1), hits(peak / mass, 1e-3, 0.3, 2), RATE, mass);
  EXPECT_EQ(ratio.parts, 5u);
  EXPECT_NEAR(ratio.value, 0.9, 1e-3);
  // A mass that is not rigid: the accelerometer sees another pulse.
  EXPECT_THAT(
      messageOf([&] { ratioByHits(hits(peak, 1e-3, 0.3, 1), hits(peak, 1.8e-3, 0.3, 2), RATE, mass); }),
      HasSubstr("differ by"));
  EXPECT_EQ(messageOf([] { ratioByHits({}, {}, RATE, 1.0); }), "0 hits: expected 3 or more");
}

TEST(Sensitivity, IsStoredAndTheRestOfTheFileStays) {
  const TemporaryFolder folder;
  const std::string file = folder.write("instrument.yaml", R"(# My front end
format: smartmill-instrument/1
name: front end
driver: tcp
options: {host: 127.0.0.1, port: 5045}
sample_rate: 51200.0   # [Hz]
streams:
  - topic: daq/vibration
    channels:
      - {input: 1, name: x, unit: m/s2, sensitivity: 0.0102, range: 5.0}   # spindle housing
      - input: 2
        name: y
        unit: m/s2
        sensitivity: 0.0100
        sensitivity_std: 1.0e-4
        range: 5.0
)");
  storeSensitivity(file, "daq/vibration", "x", 0.01044, 0.00012, "2026-11-27");
  storeSensitivity(file, "daq/vibration", "y", -0.0098, 0.00011, "2026-11-27");
  std::optional<StrictYaml> options;
  const Instrument instrument = readInstrument(file, &options);
  const std::vector<Channel> channels = instrument.channels();
  EXPECT_DOUBLE_EQ(channels[0].sensitivity, 0.01044);
  EXPECT_DOUBLE_EQ(*channels[0].sensitivity_std, 0.00012);
  EXPECT_EQ(*channels[0].sensitivity_date, "2026-11-27");
  EXPECT_DOUBLE_EQ(channels[1].sensitivity, -0.0098);
  EXPECT_DOUBLE_EQ(*channels[1].sensitivity_std, 0.00011);
  EXPECT_EQ(*channels[1].sensitivity_date, "2026-11-27");
  const std::string text = readText(file);
  EXPECT_THAT(text, HasSubstr("# My front end\n"));
  EXPECT_THAT(text, HasSubstr("range: 5.0}   # spindle housing\n"));
  EXPECT_THAT(messageOf([&] { storeSensitivity(file, "daq/vibration", "z", 1.0, 0.0, "2026-11-27"); }),
              HasSubstr("no channel z on daq/vibration"));
}

}  // namespace
}  // namespace smartmill::daq
