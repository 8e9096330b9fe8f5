#include "smartmill_core/signal/stream_check.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr double RATE = 25600.0;   // [Hz]
constexpr std::size_t SIZE = 256;  // [samples] of a block, 10 ms
constexpr double START = 1.7e9;    // [s]
constexpr double PROMPT = 0.5;     // [s] time in which a fault is to be announced

/// Blocks of a force sensor: tooth passing of 100 N and noise of 1 N.
class Blocks {
 public:
  SampleBlock next() {
    SampleBlock block;
    block.stamp = START + static_cast<double>(index_) / RATE;
    block.sample_rate = RATE;
    block.first_index = index_;
    block.channels = {"fx", "fy"};
    block.units = {"N", "N"};
    for (std::size_t i = 0; i < SIZE; ++i, ++index_) {
      const double t = static_cast<double>(index_) / RATE;
      block.samples.push_back(100.0 * std::sin(600.0 * t) + noise_(random_));
      block.samples.push_back(100.0 * std::cos(600.0 * t) + noise_(random_));
    }
    return block;
  }

 private:
  std::uint64_t index_ = 0;
  std::mt19937 random_{1};
  std::normal_distribution<double> noise_{0.0, 1.0};
};

/// Feeds 1 s of healthy blocks, then distorted ones. @return [s] until the first line; NaN: none in 1 s
double announcedAfter(StreamCheck& check, const std::function<void(SampleBlock&)>& distort,
                      std::string* line) {
  Blocks blocks;
  for (int k = 0; k < 100; ++k) {
    SampleBlock block = blocks.next();
    EXPECT_TRUE(check.check(block));
  }
  EXPECT_TRUE(check.takeLines().empty());
  for (int k = 0; k < 100; ++k) {
    SampleBlock block = blocks.next();
    distort(block);
    check.check(block);
    const std::vector<std::string> lines = check.takeLines();
    if (lines.empty()) continue;
    if (line) *line = lines.front();
    EXPECT_EQ(check.present(), lines.back());
    return static_cast<double>(k + 1) * SIZE / RATE;
  }
  return NOT_A_NUMBER;
}

TEST(StreamCheck, HealthyBlocksPassUnchanged) {
  StreamCheck check;
  Blocks blocks;
  for (int k = 0; k < 1000; ++k) {
    const SampleBlock block = blocks.next();
    SampleBlock passed = block;
    ASSERT_TRUE(check.check(passed));
    ASSERT_EQ(passed.samples, block.samples);
  }
  EXPECT_TRUE(check.takeLines().empty());
  EXPECT_EQ(check.present(), "");
}

TEST(StreamCheck, ValuesThatNoSensorGivesAreNotMeasured) {
  for (const double value : {NOT_A_NUMBER, std::numeric_limits<double>::infinity(), -1e30}) {
    StreamCheck check;
    SampleBlock seen;
    std::string line;
    const double after = announcedAfter(
        check,
        [&](SampleBlock& block) {
          block.samples[3] = value;
          seen = block;
        },
        &line);
    EXPECT_LE(after, 0.011);
    EXPECT_NE(line.find("channel fy has values that are not finite or beyond 1e9"), std::string::npos)
        << line;
    SampleBlock again = seen;
    again.first_index += SIZE;
    again.stamp += SIZE / RATE;
    EXPECT_TRUE(check.check(again));
    EXPECT_TRUE(std::isnan(again.samples[3]));
    EXPECT_EQ(again.samples[1], seen.samples[1]);
  }
}

TEST(StreamCheck, AChannelWithNoiseThatRepeatsOneValueIsStuck) {
  StreamCheck check;
  std::string line;
  const double after = announcedAfter(
      check,
      [](SampleBlock& block) {
        for (std::size_t i = 0; i < SIZE; ++i) block.samples[2 * i] = 7.0;
      },
      &line);
  EXPECT_GE(after, 0.2);
  EXPECT_LE(after, PROMPT);
  EXPECT_NE(line.find("channel fx repeats one value: stuck"), std::string::npos) << line;
}

// The current of a drive in a controller's record: digits that change while the axis moves and repeat at
// rest.
TEST(StreamCheck, AValueOfTheControllerRepeatsAtRest) {
  StreamCheck check(StreamCheck::Source::controller);
  const double after = announcedAfter(
      check,
      [](SampleBlock& block) {
        for (std::size_t i = 0; i < SIZE; ++i) block.samples[2 * i] = 0.012;
      },
      nullptr);
  EXPECT_TRUE(std::isnan(after));
}

TEST(StreamCheck, AQuietChannelIsNotStuck) {
  StreamCheck check;
  Blocks blocks;
  for (int k = 0; k < 200; ++k) {
    SampleBlock block = blocks.next();
    for (std::size_t i = 0; i < SIZE; ++i) block.samples[2 * i] = (k / 50) % 2 == 0 ? 0.0 : 5.0;  // a switch
    ASSERT_TRUE(check.check(block));
    ASSERT_FALSE(std::isnan(block.samples.front()));
  }
  EXPECT_TRUE(check.takeLines().empty());
}

// A cable that was broken from the start, too.
TEST(StreamCheck, TheChannelThatHasNotChangedForLongestIsKnown) {
  StreamCheck check;
  Blocks blocks;
  const auto push = [&](double fy) {
    SampleBlock block = blocks.next();
    for (std::size_t i = 0; i < SIZE; ++i) block.samples[2 * i + 1] = fy;
    check.check(block);
  };
  for (int k = 0; k < 50; ++k) push(3.0);
  EXPECT_EQ(check.longestUnchanged().channel, "fy");
  EXPECT_NEAR(check.longestUnchanged().duration, 0.5, 1e-3);
  EXPECT_TRUE(check.takeLines().empty());  // a channel without noise may be quiet
  push(4.0);
  EXPECT_LT(check.longestUnchanged().duration, 0.011);
}

// Ten blocks arrive as one.
TEST(StreamCheck, ALongBlockIsDelayed) {
  StreamCheck check;
  std::string line;
  announcedAfter(
      check,
      [](SampleBlock& block) {
        for (int k = 1; k < 10; ++k)
          block.samples.insert(block.samples.end(), block.samples.begin(), block.samples.begin() + 2 * SIZE);
      },
      &line);
  EXPECT_EQ(line.rfind("block of 0.100 s, usually 0.010 s: delayed", 0), 0u) << line;
}

TEST(StreamCheck, LostBlocksAreCounted) {
  StreamCheck check;
  std::string line;
  EXPECT_LE(announcedAfter(
                check,
                [](SampleBlock& block) {
                  block.first_index += 2 * SIZE;
                  block.stamp += 2 * SIZE / RATE;
                },
                &line),
            0.011);
  EXPECT_NE(line.find("512 samples lost"), std::string::npos) << line;
  EXPECT_EQ(check.count(StreamCheck::Kind::gap), 1u);
}

TEST(StreamCheck, ABlockReceivedTwiceIsDropped) {
  StreamCheck check;
  Blocks blocks;
  for (int k = 0; k < 10; ++k) {
    SampleBlock block = blocks.next(), again = block;
    EXPECT_TRUE(check.check(block));
    EXPECT_FALSE(check.check(again));
  }
  EXPECT_EQ(check.count(StreamCheck::Kind::duplicate), 10u);
  EXPECT_EQ(check.takeLines().size(), 1u);  // of an episode
}

TEST(StreamCheck, AWrongRateIsAnnouncedAndItsBlocksAreDropped) {
  for (const double factor : {0.5, 0.9, 1.1, 2.0}) {
    // Wrong from the start: no change of sample_rate announces it.
    StreamCheck check;
    Blocks blocks;
    int announced = 0, dropped = 0;
    for (int k = 1; k <= 100; ++k) {
      SampleBlock block = blocks.next();
      block.sample_rate *= factor;
      const bool used = check.check(block);
      if (!used && dropped == 0) dropped = k;
      const std::vector<std::string> lines = check.takeLines();
      if (announced > 0 || lines.empty()) continue;
      announced = k;
      EXPECT_NE(lines.front().find("stamps and index give 25600 Hz"), std::string::npos) << lines.front();
    }
    EXPECT_GT(announced, 0) << factor;
    EXPECT_LE(announced * 0.01, PROMPT) << factor;
    EXPECT_GT(dropped, announced) << factor;
    EXPECT_LE(dropped * 0.01, 1.0) << factor;
  }
}

TEST(StreamCheck, AJumpOfTheStampsIsAnnounced) {
  for (const double step : {-3.0, -0.5, -0.05, 0.05, 0.5, 3.0}) {
    StreamCheck check;
    std::string line;
    const double after = announcedAfter(
        check, [step](SampleBlock& block) { block.stamp += step; }, &line);
    EXPECT_LE(after, PROMPT) << step;
    EXPECT_NE(line.find("stamps jumped"), std::string::npos) << line;
    EXPECT_EQ(check.count(StreamCheck::Kind::jump), 1u) << step;
    EXPECT_EQ(check.count(StreamCheck::Kind::rate), 0u) << step;
  }
}

TEST(StreamCheck, StampsOfArrivalAreNoFault) {
  StreamCheck check;
  Blocks blocks;
  std::mt19937 random(2);
  std::uniform_real_distribution<double> delay(0.0, 0.002);  // [s]
  for (int k = 0; k < 1000; ++k) {
    SampleBlock block = blocks.next();
    block.stamp += delay(random);
    ASSERT_TRUE(check.check(block));
  }
  EXPECT_TRUE(check.takeLines().empty());
}

TEST(StreamCheck, ARecordingThatIsPlayedAgainIsNoFault) {
  StreamCheck check;
  for (int run = 0; run < 2; ++run) {
    Blocks blocks;
    for (int k = 0; k < 300; ++k) {
      SampleBlock block = blocks.next();
      ASSERT_TRUE(check.check(block));
    }
  }
  EXPECT_TRUE(check.takeLines().empty());
}

/// Readings of an encoder, 200 Hz.
class Readings {
 public:
  explicit Readings(double speed) : speed_(speed) {}
  SpindleAngle next() {
    const double t = 0.005 * count_++;
    return {START + t, std::fmod(speed_ * t, units::TWO_PI), speed_};
  }

 private:
  double speed_;
  int count_ = 0;
};

TEST(StreamCheck, AnAngleThatDoesNotFollowItsSpeedIsNotUsed) {
  using Distort = std::function<void(SpindleAngle&)>;
  const std::map<std::string, Distort> faults{
      {"stuck", [](SpindleAngle& r) { r.angle = 1.0; }},
      {"reversed", [](SpindleAngle& r) { r.angle = units::TWO_PI - r.angle; }},
      {"speed of another gear", [](SpindleAngle& r) { r.speed *= 1.5; }},
  };
  // At two readings per revolution (628 rad/s) both directions give the same readings.
  for (const double speed : {20.0, 157.0, 500.0, 1000.0}) {
    for (const auto& [name, distort] : faults) {
      StreamCheck check;
      Readings readings(speed);
      for (int k = 0; k < 200; ++k) EXPECT_TRUE(check.check(readings.next()));
      EXPECT_TRUE(check.takeLines().empty());
      int announced = 0, used = 0;
      for (int k = 1; k <= 200; ++k) {
        SpindleAngle reading = readings.next();
        distort(reading);
        used += check.check(reading);
        if (announced == 0 && !check.takeLines().empty()) announced = k;
      }
      EXPECT_GT(announced, 0) << name << " at " << speed;
      const double limit = std::max(PROMPT, 5.0 * units::TWO_PI / speed);  // [s] or five revolutions
      EXPECT_LE(announced * 0.005, limit) << name << " at " << speed;
      EXPECT_LE(used * 0.005, limit) << name << " at " << speed;
    }
  }
}

TEST(StreamCheck, ASpindleThatStartsTurnsAndStopsIsNoFault) {
  StreamCheck check;
  double angle = 0.0, speed = 0.0;
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 1e-3);  // [rad]
  for (int k = 0; k < 4000; ++k) {
    // At rest, 1 s of run-up to 6000 rpm, constant, run-down, at rest.
    const double target = k > 400 && k < 2400 ? 628.3 : 0.0, before = speed;
    speed += std::clamp(target - speed, -3.2, 3.2);
    angle = std::fmod(angle + 0.5 * (before + speed) * 0.005, units::TWO_PI);
    ASSERT_TRUE(check.check(SpindleAngle{START + 0.005 * k, angle + noise(random), speed})) << k;
  }
  EXPECT_TRUE(check.takeLines().empty());
}

// The controller may orient the spindle backwards, with an unsigned speed.
TEST(StreamCheck, AnOrientationIsNoFault) {
  StreamCheck check;
  double angle = 0.2;
  for (int k = 0; k < 2000; ++k) {
    const bool turns = k % 400 >= 100 && k % 400 < 150;  // 3 rad at 12 rad/s
    if (turns) angle = std::fmod(angle - 12.0 * 0.005 + units::TWO_PI, units::TWO_PI);
    ASSERT_TRUE(check.check(SpindleAngle{START + 0.005 * k, angle, turns ? 12.0 : 0.0})) << k;
  }
  EXPECT_TRUE(check.takeLines().empty());
}

TEST(StreamCheck, ReadingsOutOfRangeOrTwiceAreNotUsed) {
  StreamCheck check;
  Readings readings(100.0);
  const SpindleAngle first = readings.next();
  EXPECT_TRUE(check.check(first));
  EXPECT_FALSE(check.check(first));
  SpindleAngle wrong = readings.next();
  wrong.speed = 1e30;
  EXPECT_FALSE(check.check(wrong));
  wrong.speed = -1.0;
  EXPECT_FALSE(check.check(wrong));
  EXPECT_EQ(check.takeLines().size(), 2u);
}

TEST(StreamCheck, ReadingsThatAreMissingAreNoJump) {
  StreamCheck check;
  Readings readings(157.0);
  for (int k = 0; k < 200; ++k) EXPECT_TRUE(check.check(readings.next()));
  for (int k = 0; k < 40; ++k) readings.next();
  EXPECT_TRUE(check.check(readings.next()));
  EXPECT_EQ(check.count(StreamCheck::Kind::gap), 1u);
  EXPECT_EQ(check.count(StreamCheck::Kind::jump), 0u);
}

TEST(SpeedAgreement, SteadySpeedsThatDifferAreAnnounced) {
  SpeedAgreement agreement;
  int lines = 0, first = 0;
  // Run-up of 1 s that the controller reports 0.1 s later, then the tachometer has another gear.
  for (int k = 0; k < 1200; ++k) {
    const double t = 0.005 * k, gear = k < 800 ? 1.0 : 1.5;
    agreement.setController(START + t, 628.0 * std::clamp(t - 0.1, 0.0, 1.0));
    const std::string line = agreement.check({START + t, 0.0, gear * 628.0 * std::clamp(t, 0.0, 1.0)});
    if (line.empty()) continue;
    if (lines++ == 0) first = k;
    EXPECT_NE(line.find("speed 942 rad/s, the controller states 628 rad/s"), std::string::npos) << line;
  }
  EXPECT_EQ(lines, 1);
  EXPECT_GT(first, 800);
  EXPECT_LE((first - 800) * 0.005, PROMPT);
}

TEST(SpeedAgreement, AControllerWithoutSpeedIsNotCompared) {
  SpeedAgreement agreement;
  for (int k = 0; k < 400; ++k) {
    agreement.setController(START + 0.005 * k, k < 200 ? 0.0 : NOT_A_NUMBER);
    EXPECT_EQ(agreement.check({START + 0.005 * k, 0.0, 100.0}), "");
  }
}

}  // namespace
}  // namespace smartmill
