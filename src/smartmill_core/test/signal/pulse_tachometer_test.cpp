#include "smartmill_core/signal/pulse_tachometer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using units::TWO_PI;

constexpr double RATE = 25600.0;           // [Hz]
constexpr std::size_t BLOCK = 256;         // samples
constexpr double FAST = 2 * M_PI * 100.0;  // [rad/s] 6000 rpm

/// Turned angle [rad] over time [s].
using Motion = std::function<double(double)>;

Motion constant(double speed, double phase = 0.3) {
  return [=](double t) { return phase + speed * t; };
}

/// An optical sensor: 5 V over a fifth of each pitch, from the angle of the pulse on.
double sensorVoltage(double turned, const PulseTachometerParameters& parameters) {
  const double pitches = (turned - parameters.angle) * parameters.pulses_per_revolution / TWO_PI;
  return pitches - std::floor(pitches) < 0.2 ? 5.0 : 0.0;
}

/// Sampled by a data acquisition in blocks.
struct Signal {
  PulseTachometerParameters parameters;
  double rate = RATE;
  std::function<void(double, double&)> disturb = [](double, double&) {};

  SampleBlock block(const Motion& motion, std::size_t first, std::size_t size) const {
    SampleBlock b;
    b.stamp = static_cast<double>(first) / rate;
    b.sample_rate = rate;
    b.first_index = first;
    b.channels = {"tachometer"};
    b.units = {"V"};
    for (std::size_t i = 0; i < size; ++i) {
      const double time = static_cast<double>(first + i) / rate;
      double volt = sensorVoltage(motion(time), parameters);
      disturb(time, volt);
      b.samples.push_back(volt);
    }
    return b;
  }
  std::vector<PulseReading> run(PulseTachometer& tachometer, const Motion& motion, double duration) const {
    std::vector<PulseReading> all;
    for (std::size_t i = 0; static_cast<double>(i) < duration * rate; i += BLOCK) {
      for (const PulseReading& r : tachometer.push(block(motion, i, BLOCK))) all.push_back(r);
    }
    return all;
  }
};

double angleError(const PulseReading& reading, const Motion& motion) {
  return std::remainder(reading.angle.angle - motion(reading.angle.stamp), TWO_PI);
}

double speedOf(const Motion& motion, double time) {
  constexpr double STEP = 1e-6;
  return (motion(time + STEP) - motion(time - STEP)) / (2.0 * STEP);
}

TEST(PulseTachometer, ConstantSpeedFollowsTheClosedForm) {
  for (const int pulses : {1, 4, 20}) {
    Signal signal;
    signal.parameters.pulses_per_revolution = pulses;
    signal.parameters.angle = 1.1;
    PulseTachometer tachometer(signal.parameters);
    const Motion motion = constant(FAST);
    const auto readings = signal.run(tachometer, motion, 1.0);
    // A reading a pulse, but for the first three.
    EXPECT_NEAR(static_cast<double>(readings.size()), 100.0 * pulses - 3.0, 1.0);
    const double pitch = TWO_PI / pulses;
    for (const PulseReading& r : readings) {
      // Half a sample, 0.0123 rad, is the largest error of a pulse; the angle is that of a pulse up to a
      // pitch.
      EXPECT_LT(std::abs(std::remainder(r.angle.angle - motion(r.angle.stamp), pitch)), FAST / RATE * 0.6);
      EXPECT_LT(std::abs(r.angle.speed - FAST), 5.0 * r.speed_std);
    }
    // Fifty pulses or half a second: 4 sqrt(3) sigma / (T sqrt(n)) and less.
    EXPECT_NEAR(readings.back().angle.speed / FAST, 1.0, 2e-4) << pulses;
    EXPECT_EQ(tachometer.counts().missing + tachometer.counts().doubled + tachometer.counts().irregular, 0u);
  }
}

double between(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

Motion drawConstant(std::mt19937_64& random) {
  return constant(between(random, 200.0, 900.0), between(random, 0.0, TWO_PI));
}

/// 5 to 8 % of the speed a second, curved within half a second.
Motion drawRamp(std::mt19937_64& random) {
  const double speed = between(random, 400.0, 800.0), phase = between(random, 0.0, TWO_PI);
  const double acceleration = speed * between(random, 0.05, 0.08);
  return [=](double t) { return phase + speed * t + 0.5 * acceleration * t * t; };
}

struct Coverages {
  Coverage angle, speed;
  void add(const PulseReading& last, const Motion& motion, int pulses) {
    angle.add(std::remainder(last.angle.angle - motion(last.angle.stamp), TWO_PI / pulses), last.angle_std);
    speed.add(last.angle.speed - speedOf(motion, last.angle.stamp), last.speed_std);
  }
};

// Pulses with independent errors of their times: the deviations are right from both sides.
TEST(PulseTachometer, DeviationsAreCalibrated) {
  for (const auto draw : {drawConstant, drawRamp}) {
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    Coverages coverage;
    for (int run = 0; run < Coverage::RUNS; ++run) {
      PulseTachometer tachometer({});
      const Motion motion = draw(random);
      constexpr double STD = 1e-5;  // [s]
      std::optional<PulseReading> last;
      for (int pulse = 1; pulse < 60; ++pulse) {
        double time = 0.0;  // at which the motion is at the pulse, by Newton's method
        for (int i = 0; i < 20; ++i) time -= (motion(time) - TWO_PI * (pulse + 1)) / speedOf(motion, time);
        last = tachometer.push(time + STD * normal(random), STD);
      }
      ASSERT_TRUE(last);
      // The reading is for the measured time: its error is that of the fit.
      coverage.add(*last, motion, 1);
    }
    EXPECT_TRUE(coverage.angle.isCalibrated());
    EXPECT_TRUE(coverage.speed.isCalibrated());
  }
}

// A sampled channel: at a constant speed the samples divide the pulses' periods evenly, so that their errors
// average better than independent ones. The deviations are at most 1.2 times too small, at most twice too
// large.
TEST(PulseTachometer, DeviationsFromTheSamplingAreRight) {
  for (const auto draw : {drawConstant, drawRamp}) {
    for (const int pulses : {1, 4}) {
      std::mt19937_64 random(11);
      Coverages coverage;
      for (int run = 0; run < Coverage::RUNS; ++run) {
        Signal signal;
        signal.parameters.pulses_per_revolution = pulses;
        PulseTachometer tachometer(signal.parameters);
        const Motion motion = draw(random);
        const auto readings = signal.run(tachometer, motion, 0.6);
        ASSERT_FALSE(readings.empty());
        coverage.add(readings.back(), motion, pulses);
      }
      for (const Coverage* c : {&coverage.angle, &coverage.speed}) {
        EXPECT_GT(c->rms(), 0.5) << pulses;
        EXPECT_LT(c->rms(), 1.2) << pulses;
      }
    }
  }
}

TEST(PulseTachometer, ARunUpIsFollowedWithinTheStatedDeviation) {
  // From rest to 6000 rpm in one second.
  const Motion motion = [](double t) { return 0.3 + 0.5 * FAST * t * t; };
  Signal signal;
  signal.parameters.pulses_per_revolution = 2;
  PulseTachometer tachometer(signal.parameters);
  const auto readings = signal.run(tachometer, motion, 1.0);
  ASSERT_GT(readings.size(), 80u);
  for (const PulseReading& r : readings) {
    if (std::isnan(r.angle.angle)) continue;  // at rest before
    EXPECT_LT(std::abs(r.angle.speed - FAST * r.angle.stamp), 4.0 * r.speed_std + 1e-9) << r.angle.stamp;
  }
  EXPECT_NEAR(readings.back().angle.speed / (FAST * readings.back().angle.stamp), 1.0, 3e-3);
}

TEST(PulseTachometer, ARippleIsFollowedWithinTheStatedDeviation) {
  // 2 % at the spindle frequency, with 16 pulses per revolution: 16 samples per period at 6000 rpm, 160 at
  // 600.
  for (const double speed : {FAST / 10.0, FAST / 2.0, FAST}) {
    const Motion motion = [speed](double t) { return speed * t - 0.02 * std::cos(speed * t); };
    Signal signal;
    signal.parameters.pulses_per_revolution = 16;
    PulseTachometer tachometer(signal.parameters);
    Coverage coverage;
    double worst = 0.0;
    for (const PulseReading& r : signal.run(tachometer, motion, 1.0)) {
      const double error = r.angle.speed - speedOf(motion, r.angle.stamp);
      worst = std::max(worst, std::abs(error) / speed);
      coverage.add(error, r.speed_std);
    }
    EXPECT_GT(coverage.size(), 140u);
    // The change of the speed between pulses is a deviation in size only, not the error itself.
    EXPECT_LT(coverage.rms(), 2.0) << speed;
    EXPECT_GT(coverage.rms(), 0.5) << speed;
    EXPECT_LT(worst, 0.05) << speed;
  }
}

TEST(PulseTachometer, AMissingPulseIsAnnouncedAndTheAngleStaysRight) {
  Signal signal;
  signal.disturb = [](double t, double& volt) {
    if (t > 0.505 && t < 0.515) volt = 0.0;
  };
  PulseTachometer tachometer(signal.parameters);
  const Motion motion = constant(FAST);
  for (const PulseReading& r : signal.run(tachometer, motion, 0.8)) {
    EXPECT_LT(std::abs(angleError(r, motion)), 0.02);
    EXPECT_NEAR(r.angle.speed / FAST, 1.0, 0.01);
  }
  EXPECT_EQ(tachometer.counts().missing, 1u);
  EXPECT_NE(tachometer.takeFault().find("1 pulse is missing before 0.5"), std::string::npos);
  EXPECT_TRUE(tachometer.takeFault().empty());
}

TEST(PulseTachometer, ADoublePulseIsAnnouncedAndNotUsed) {
  Signal signal, clean;
  PulseTachometer tachometer(signal.parameters);
  const Motion motion = constant(FAST, 0.0);  // pulses at 0.50 s, 0.51 s
  PulseTachometer reference(clean.parameters);
  signal.disturb = [](double t, double& volt) {
    if (t > 0.504 && t < 0.505) volt = 5.0;
  };
  const auto readings = signal.run(tachometer, motion, 0.8), expected = clean.run(reference, motion, 0.8);
  // No reading for the next pulse, as either of the two may be the double one.
  ASSERT_EQ(readings.size() + 1, expected.size());
  EXPECT_EQ(readings.back().angle.speed, expected.back().angle.speed);
  EXPECT_EQ(readings.back().angle.angle, expected.back().angle.angle);
  EXPECT_EQ(tachometer.counts().doubled, 1u);
  EXPECT_NE(tachometer.takeFault().find("double pulse at 0.504"), std::string::npos);
}

TEST(PulseTachometer, HysteresisIgnoresNoiseAtTheEdge) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Signal signal;
  signal.disturb = [&](double, double& volt) { volt += 0.2 * normal(random); };
  PulseTachometer tachometer(signal.parameters);
  signal.run(tachometer, constant(FAST), 1.0);
  EXPECT_EQ(tachometer.counts().doubled + tachometer.counts().missing, 0u);
  EXPECT_NEAR(static_cast<double>(tachometer.counts().pulses), 100.0, 1.0);
}

TEST(PulseTachometer, AStoppedSpindleHasNoAngle) {
  const Motion motion = [](double t) { return FAST * std::min(t, 0.5); };
  Signal signal;
  PulseTachometer tachometer(signal.parameters);
  const auto readings = signal.run(tachometer, motion, 2.0);
  EXPECT_EQ(tachometer.state(), PulseTachometer::State::at_rest);
  EXPECT_EQ(readings.back().angle.speed, 0.0);
  EXPECT_TRUE(std::isnan(readings.back().angle.angle));
  for (const PulseReading& r : readings) {
    if (r.angle.stamp > 0.5 + 0.01 + signal.parameters.longest_period) {
      EXPECT_EQ(r.angle.speed, 0.0);
    }
    // Between the last pulse and the longest period there is no reading.
    EXPECT_FALSE(r.angle.stamp > 0.52 && r.angle.stamp < 0.48 + signal.parameters.longest_period);
  }
}

TEST(PulseTachometer, AStuckChannelGivesNoReadingWhileTheControllerReportsASpeed) {
  for (const double level : {0.0, 5.0}) {
    Signal signal;
    signal.disturb = [level](double t, double& volt) {
      if (t > 0.5) volt = level;
    };
    PulseTachometer tachometer(signal.parameters);
    tachometer.setControllerSpeed(FAST);
    const auto readings = signal.run(tachometer, constant(FAST), 2.0);
    EXPECT_EQ(tachometer.state(), PulseTachometer::State::no_pulses);
    EXPECT_LT(readings.back().angle.stamp, 0.52);
    EXPECT_NE(tachometer.takeFault().find("the controller reports 6000 rpm"), std::string::npos);
  }
}

TEST(PulseTachometer, LostSamplesAndNotFiniteOnesAreAnnounced) {
  Signal signal;
  PulseTachometer tachometer(signal.parameters);
  const Motion motion = constant(FAST);
  signal.run(tachometer, motion, 0.5);
  EXPECT_EQ(tachometer.state(), PulseTachometer::State::turning);
  EXPECT_TRUE(tachometer.push(signal.block(motion, 20000, BLOCK)).empty());
  EXPECT_EQ(tachometer.counts().gaps, 1u);
  EXPECT_EQ(tachometer.state(), PulseTachometer::State::waiting);
  EXPECT_NE(tachometer.takeFault().find("samples lost before 0.781 s"), std::string::npos);
  SampleBlock block = signal.block(motion, 20000 + BLOCK, BLOCK);
  block.samples[5] = NOT_A_NUMBER;
  tachometer.push(block);
  EXPECT_EQ(tachometer.counts().not_finite, 1u);
}

TEST(PulseTachometer, ChangedPeriodStartsAnewWithoutAWrongReading) {
  // The period is halved from one pulse to the next: not a motion of a spindle, but possible for a channel.
  const Motion motion = [](double t) { return t < 0.5 ? FAST * t : FAST * 0.5 + 2.0 * FAST * (t - 0.5); };
  Signal signal;
  PulseTachometer tachometer(signal.parameters);
  for (const PulseReading& r : signal.run(tachometer, motion, 1.0)) {
    EXPECT_NEAR(r.angle.speed / (r.angle.stamp < 0.501 ? FAST : 2.0 * FAST), 1.0, 0.02) << r.angle.stamp;
  }
  EXPECT_GE(tachometer.counts().doubled, 1u);
  EXPECT_EQ(tachometer.state(), PulseTachometer::State::turning);
}

TEST(PulseTachometer, TimeStampsOfPulsesGiveTheSame) {
  PulseTachometer tachometer({});
  std::optional<PulseReading> last;
  for (int i = 0; i < 50; ++i) last = tachometer.push(0.01 * i, 1e-6);
  ASSERT_TRUE(last);
  EXPECT_NEAR(last->angle.speed, FAST, 1e-6);
  EXPECT_NEAR(std::remainder(last->angle.angle, TWO_PI), 0.0, 1e-9);
  // A line over n = 50 pulses: sigma sqrt(12 / (n (n^2 - 1))) of the period.
  EXPECT_NEAR(last->speed_std / FAST, 1e-6 / 0.01 * std::sqrt(12.0 / (50.0 * 2499.0)), 1e-9);
  EXPECT_THROW(tachometer.push(1.0, 0.0), Error);
}

TEST(PulseTachometer, RefusesBadInputByOneLine) {
  PulseTachometerParameters parameters;
  parameters.pulses_per_revolution = 0;
  EXPECT_THROW(PulseTachometer{parameters}, Error);
  PulseTachometer tachometer({});
  SampleBlock block;
  block.sample_rate = RATE;
  block.channels = {"tachometer"};
  block.units = {"A"};
  block.samples = {0.0};
  try {
    tachometer.push(block);
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "sample block: channel tachometer: unit 'A', expected 'V'");
  }
}

struct Columns {
  std::vector<double> time, volt;
};

Columns record(const Motion& motion, const PulseTachometerParameters& parameters, double duration) {
  Columns c;
  for (std::size_t i = 0; static_cast<double>(i) < duration * RATE; ++i) {
    c.time.push_back(static_cast<double>(i) / RATE);
    c.volt.push_back(sensorVoltage(motion(c.time.back()), parameters));
  }
  return c;
}

TEST(AngleOfPulses, IsLinearBetweenPulses) {
  PulseTachometerParameters parameters;
  parameters.angle = 0.7;
  const Motion motion = [](double t) { return 0.2 + FAST * t + 20.0 * t * t; };
  const Columns c = record(motion, parameters, 0.5);
  std::vector<std::string> notes;
  const auto angle = angleOfPulses(c.time, c.volt, parameters, "r.csv: column tachometer", &notes);
  for (std::size_t i = 0; i < angle.size(); ++i) {
    EXPECT_GE(angle[i], 0.0);
    EXPECT_LT(angle[i], TWO_PI);
    // One sample and the curvature over a revolution, 20 (T/2)^2.
    EXPECT_LT(std::abs(std::remainder(angle[i] - motion(c.time[i]), TWO_PI)), FAST / RATE + 2e-3) << i;
  }
  EXPECT_TRUE(notes.empty());
}

TEST(AngleOfPulses, AnnouncesMissingAndDoubleAndRefusesIrregularPulses) {
  const PulseTachometerParameters parameters;
  const Motion motion = constant(FAST, 0.0);
  Columns c = record(motion, parameters, 0.5);
  for (std::size_t i = 0; i < c.time.size(); ++i) {
    if (c.time[i] > 0.195 && c.time[i] < 0.205) c.volt[i] = 0.0;
    if (c.time[i] > 0.304 && c.time[i] < 0.305) c.volt[i] = 5.0;
  }
  std::vector<std::string> notes;
  const auto angle = angleOfPulses(c.time, c.volt, parameters, "r.csv: column tachometer", &notes);
  EXPECT_EQ(notes, std::vector<std::string>{"r.csv: column tachometer: 1 pulses missing, 1 double"});
  for (std::size_t i = 0; i < angle.size(); ++i)
    EXPECT_LT(std::abs(std::remainder(angle[i] - motion(c.time[i]), TWO_PI)), FAST / RATE);
  const Motion jump = [](double t) { return FAST * t * (t < 0.25 ? 1.0 : 0.6); };
  const Columns bad = record(jump, parameters, 0.5);
  try {
    angleOfPulses(bad.time, bad.volt, parameters, "r.csv: column tachometer", nullptr);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("r.csv: column tachometer: irregular pulse at 0."),
              std::string::npos)
        << error.what();
  }
  EXPECT_THROW(angleOfPulses(c.time, std::vector<double>(c.time.size(), 0.0), parameters, "r.csv", nullptr),
               Error);
}

}  // namespace
}  // namespace smartmill
