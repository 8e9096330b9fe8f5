#include "smartmill_stability/chatter/sound_listener.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using ::testing::HasSubstr;
using Kind = RecordingVerdict::Kind;
using State = SoundState::Kind;

constexpr double RATE = 16000.0, RPM = 6000.0;
constexpr int TEETH = 2;  // tooth passing frequency 200 Hz at 6000 rpm

struct Tone {
  double frequency, size;
};

/// A microphone at a machine whose sounds are tones in noise: each part follows the one before without a gap.
class Workshop {
 public:
  explicit Workshop(SoundParameters parameters) : listener(parameters) {}

  void play(double seconds, const std::vector<Tone>& tones, double noise = 1.0) {
    constexpr std::size_t BLOCK = 160;
    for (auto left = static_cast<std::size_t>(seconds * RATE / BLOCK); left > 0; --left) {
      SampleBlock block;
      block.stamp = START + static_cast<double>(index) / RATE;
      block.sample_rate = RATE;
      block.first_index = index;
      block.channels = {"sound"};
      block.units = {"1"};
      for (std::size_t i = 0; i < BLOCK; ++i) {
        const double t = static_cast<double>(index++) / RATE;
        double v = noise * normal(random);
        for (const Tone& tone : tones) v += tone.size * std::sin(units::TWO_PI * tone.frequency * t);
        v *= gain;
        block.samples.push_back(std::abs(v) < full ? v : NAN);  // as daq_node
      }
      listener.push(block);
      work();
    }
  }
  /// Orders of the idle spindle.
  void idle(double seconds, double rpm = RPM) {
    std::vector<Tone> tones;
    for (int k : {1, 3, 5}) tones.push_back({k * rpm / 60.0, 1.0});
    play(seconds, tones);
  }
  void cut(double seconds, double rpm, const std::vector<double>& chatter = {}) {
    std::vector<Tone> tones;
    for (int k : {1, 3, 5}) tones.push_back({k * rpm / 60.0, 1.0});
    for (int k = 1; k <= 5; ++k) tones.push_back({k * TEETH * rpm / 60.0, 6.0 / k});
    for (const double f : chatter)
      for (int k : {-1, 0, 1}) tones.push_back({f + k * TEETH * rpm / 60.0, k == 0 ? 6.0 : 2.0});
    play(seconds, tones, 1.5);
  }
  void set(double rpm) {
    CutSetting setting;
    setting.speed = units::radPerSecFromRpm(rpm);
    listener.set(setting);
  }
  const SoundState& state() const { return listener.state(); }
  std::vector<std::string> lines;

  static constexpr double START = 1000.0;  // [s]
  std::uint64_t index = 0;
  double gain = 1.0, full = INFINITY;
  SoundListener listener;

 private:
  void work() {
    while (const auto job = listener.nextJob()) listener.finish(job->run());
    for (const std::string& line : listener.takeLines()) lines.push_back(line);
  }
  std::mt19937_64 random{5};
  std::normal_distribution<double> normal;
};

SoundParameters parameters() {
  SoundParameters p;
  p.teeth = TEETH;
  p.speed_low = units::radPerSecFromRpm(4000.0);
  p.speed_high = units::radPerSecFromRpm(12000.0);
  p.speed = units::radPerSecFromRpm(RPM);
  return p;
}

TEST(SoundListener, aChatteringCutIsJudgedAndASpeedProposed) {
  Workshop shop(parameters());
  EXPECT_EQ(shop.state().kind, State::no_sound);
  shop.idle(2.0);
  EXPECT_EQ(shop.state().kind, State::idle);
  EXPECT_TRUE(shop.state().tries.empty());
  shop.cut(3.0, RPM, {873.0});
  EXPECT_EQ(shop.state().kind, State::cutting);
  // Announced while it is cutting.
  ASSERT_EQ(shop.state().tries.size(), 1u);
  EXPECT_TRUE(shop.state().running);
  EXPECT_EQ(shop.state().tries[0].kind, Kind::chatter);
  EXPECT_FALSE(shop.state().advice.speeds.empty());
  shop.idle(1.0);
  EXPECT_EQ(shop.state().kind, State::idle);
  ASSERT_EQ(shop.state().tries.size(), 1u);
  EXPECT_FALSE(shop.state().running);
  const SoundTry heard = shop.state().tries[0];
  EXPECT_EQ(heard.kind, Kind::chatter) << heard.text;
  EXPECT_NEAR(heard.frequency, 873.0, 1.0);
  EXPECT_GT(heard.probability, 0.8);
  EXPECT_NEAR(units::rpmFromRadPerSec(heard.speed), RPM, 6.0);
  EXPECT_NEAR(heard.begin, Workshop::START + 2.0, 0.2);
  EXPECT_NEAR(heard.end, Workshop::START + 5.0, 0.2);
  ASSERT_FALSE(shop.state().advice.speeds.empty());
  // The search of the same cut.
  SpeedSearch search(TEETH, parameters().speed_low, parameters().speed_high);
  search.heard({heard.speed, heard.frequency});
  EXPECT_EQ(shop.state().advice.speeds[0].speed, search.next().speed);
  // The frequency of the first part, which differs by 0.5 % at most.
  EXPECT_NEAR(shop.state().advice.speeds[0].stable, search.next().stable, 0.02);
}

// Listening begins in a cut: only its end is heard.
TEST(SoundListener, aCutThatRunsWhenListeningBeginsIsJudgedAfterItsEnd) {
  Workshop shop(parameters());
  shop.cut(6.0, RPM, {873.0});
  EXPECT_TRUE(shop.state().tries.empty());
  shop.idle(1.5);
  ASSERT_EQ(shop.state().tries.size(), 1u);
  const SoundTry heard = shop.state().tries[0];
  EXPECT_EQ(heard.kind, Kind::chatter) << heard.text;
  EXPECT_NEAR(heard.frequency, 873.0, 1.0);
  EXPECT_NEAR(heard.begin, Workshop::START, 0.2);
  EXPECT_NEAR(heard.end, Workshop::START + 6.0, 0.2);
  ASSERT_FALSE(shop.state().advice.speeds.empty());
  // The next cut is heard as any other, also one that begins before a second of air is over.
  shop.cut(2.5, RPM);
  shop.idle(1.5);
  ASSERT_EQ(shop.state().tries.size(), 2u);
  EXPECT_EQ(shop.state().tries[1].kind, Kind::stable) << shop.state().tries[1].text;

  Workshop hasty(parameters());
  hasty.cut(4.0, RPM, {873.0});
  hasty.idle(0.8);
  hasty.cut(2.5, RPM, {873.0});
  hasty.idle(1.5);
  ASSERT_EQ(hasty.state().tries.size(), 2u);
  for (const SoundTry& one : hasty.state().tries) EXPECT_EQ(one.kind, Kind::chatter) << one.text;
}

// As a stable cut that ends when listening has begun in it.
TEST(SoundListener, aSpindleThatStopsIsNoCut) {
  Workshop shop(parameters());
  std::vector<Tone> spindle;
  for (int k = 1; k < 40; ++k) spindle.push_back({k * RPM / 60.0, 2.0});
  shop.play(4.0, spindle, 3.0);
  shop.play(3.0, {}, 0.2);
  EXPECT_TRUE(shop.state().tries.empty());
}

TEST(SoundListener, eachTryImprovesTheAdviceUntilACutIsStable) {
  Workshop shop(parameters());
  shop.idle(2.0);
  shop.cut(2.5, RPM, {873.0});
  const double next = units::rpmFromRadPerSec(shop.state().advice.speeds.at(0).speed);
  shop.set(next);
  shop.idle(3.0, next);
  shop.cut(2.5, next, {861.0});
  shop.idle(1.5, next);
  ASSERT_EQ(shop.state().tries.size(), 2u) << shop.lines.back();
  EXPECT_EQ(shop.state().tries[1].kind, Kind::chatter) << shop.state().tries[1].text;
  const double third = units::rpmFromRadPerSec(shop.state().advice.speeds.at(0).speed);
  EXPECT_GT(std::abs(third / next - 1.0), 0.01);
  shop.set(third);
  shop.idle(3.0, third);
  shop.cut(2.5, third);
  shop.idle(1.5, third);
  ASSERT_EQ(shop.state().tries.size(), 3u) << shop.lines.back();
  EXPECT_EQ(shop.state().tries[2].kind, Kind::stable) << shop.state().tries[2].text;
  EXPECT_TRUE(shop.state().advice.speeds.empty());
  EXPECT_EQ(shop.state().advice.used, std::vector<bool>(3, true));
}

// A tool that touches the part, leaves it for less than a window and cuts: what is outside the cut contains
// a part of it. A tone of another machine is in the background all the same.
TEST(SoundListener, aShortPauseInACutIsNoBackground) {
  for (const double touch : {0.15, 0.2, 0.25}) {
    for (const double pause : {0.2, 0.3}) {
      Workshop shop(parameters());
      shop.idle(2.0);
      shop.cut(touch, RPM, {873.0});
      shop.idle(pause);
      shop.cut(2.5, RPM, {873.0});
      shop.idle(1.5);
      ASSERT_FALSE(shop.state().tries.empty()) << touch << " s, " << pause << " s";
      const SoundTry& heard = shop.state().tries.back();
      EXPECT_EQ(heard.kind, Kind::chatter) << touch << " s, " << pause << " s: " << heard.text;
    }
  }
  Workshop shop(parameters());
  const Tone pump{873.0, 8.0};
  std::vector<Tone> air{pump}, cut{pump};
  for (int k : {1, 3, 5}) air.push_back({k * RPM / 60.0, 1.0});
  for (int k = 1; k <= 5; ++k) cut.push_back({k * TEETH * RPM / 60.0, 12.0 / k});
  shop.play(2.0, air);
  shop.play(0.2, cut, 1.5);
  shop.play(0.2, air);
  shop.play(2.5, cut, 1.5);
  shop.play(1.5, air);
  ASSERT_FALSE(shop.state().tries.empty());
  EXPECT_EQ(shop.state().tries.back().kind, Kind::stable) << shop.state().tries.back().text;
}

// A spindle that starts, coolant, a bang: none is a try; their level is then that of the air.
TEST(SoundListener, whatIsNoCutIsNoTry) {
  Workshop shop(parameters());
  shop.play(2.0, {});
  shop.idle(6.0);
  EXPECT_EQ(shop.state().kind, State::idle) << shop.lines.back();
  shop.play(0.2, {}, 20.0);  // a bang
  shop.idle(2.0);
  EXPECT_EQ(shop.state().kind, State::idle);
  shop.play(6.0, {{100.0, 1.0}, {300.0, 1.0}, {500.0, 1.0}}, 4.0);  // coolant
  EXPECT_EQ(shop.state().kind, State::idle) << shop.lines.back();
  EXPECT_TRUE(shop.state().tries.empty()) << shop.state().tries[0].text;
  shop.cut(2.5, RPM, {873.0});
  EXPECT_EQ(shop.state().tries.size(), 1u);
}

TEST(SoundListener, aMicrophoneThatStopsInTheCutIsOneLine) {
  Workshop shop(parameters());
  shop.idle(2.0);
  shop.cut(1.5, RPM, {873.0});
  shop.lines.clear();
  shop.listener.stop("unplugged");
  shop.listener.stop("unplugged");
  EXPECT_EQ(shop.listener.takeLines(),
            std::vector<std::string>{"no sound: unplugged, in a cut: the 1.5 s that were heard are judged"});
  EXPECT_EQ(shop.state().kind, State::no_sound);
  EXPECT_TRUE(std::isnan(shop.state().level));
  // Back, with another index: what was heard of the cut is a try.
  shop.index += 50000;
  shop.idle(1.0);
  EXPECT_EQ(shop.state().kind, State::idle);
  ASSERT_EQ(shop.state().tries.size(), 1u);
  EXPECT_EQ(shop.state().tries[0].kind, Kind::chatter) << shop.state().tries[0].text;
  shop.cut(2.5, RPM, {873.0});
  shop.idle(1.0);
  EXPECT_EQ(shop.state().tries.size(), 2u);
}

TEST(SoundListener, lostSamplesEndACutAndAFewAreBridged) {
  Workshop shop(parameters());
  shop.idle(2.0);
  shop.cut(1.0, RPM, {873.0});
  shop.index += 100;
  shop.cut(1.0, RPM, {873.0});
  EXPECT_EQ(shop.state().kind, State::cutting);
  shop.index += 4000;
  shop.cut(0.2, RPM, {873.0});
  EXPECT_THAT(shop.lines, ::testing::Contains(HasSubstr("4000 samples are missing, in a cut")));
}

TEST(SoundListener, aMicrophoneThatNeverSendsIsOneLine) {
  SoundListener listener(parameters());
  listener.stop("no samples");
  listener.stop("no samples");
  EXPECT_EQ(listener.takeLines(), std::vector<std::string>{"no sound: no samples"});
}

TEST(SoundListener, mutedIsNoSound) {
  Workshop shop(parameters());
  shop.idle(1.0);
  shop.full = 0.0;
  shop.idle(1.0);
  EXPECT_EQ(shop.state().kind, State::no_sound);
  EXPECT_EQ(shop.lines.back(), "no sound: no values: muted or stuck");
}

TEST(SoundListener, aReplayFromTheBeginningForgetsTheTries) {
  Workshop shop(parameters());
  shop.idle(2.0);
  shop.cut(2.5, RPM, {873.0});
  shop.idle(1.0);
  ASSERT_EQ(shop.state().tries.size(), 1u);
  shop.index = 0;
  shop.idle(0.1);
  EXPECT_TRUE(shop.state().tries.empty());
}

// The shares of clipped samples are reported, and chatter is heard in spite of them.
TEST(SoundListener, clippingIsReported) {
  Workshop shop(parameters());
  shop.full = 12.0;
  shop.idle(2.0);
  EXPECT_EQ(shop.state().clipped, 0.0);
  shop.cut(2.5, RPM, {873.0});
  EXPECT_GT(shop.state().clipped, 0.001);
  ASSERT_EQ(shop.state().tries.size(), 1u);
  EXPECT_GT(shop.state().tries[0].clipped, 0.001);
  EXPECT_EQ(shop.state().tries[0].kind, Kind::chatter) << shop.state().tries[0].text;
  EXPECT_NEAR(shop.state().tries[0].frequency, 873.0, 1.0);
}

// Nothing depends on the unit of the microphone.
TEST(SoundListener, theGainDoesNotMatter) {
  for (const double gain : {1e-4, 1e3}) {
    Workshop shop(parameters());
    shop.gain = gain;
    shop.idle(2.0);
    shop.cut(2.5, RPM, {873.0});
    ASSERT_EQ(shop.state().tries.size(), 1u);
    EXPECT_NEAR(shop.state().tries[0].frequency, 873.0, 1.0);
  }
}

TEST(SoundListener, theControllersSpeedIsUsedWhereThereIsOne) {
  SoundParameters p = parameters();
  p.speed = 0.0;
  Workshop shop(p);
  shop.idle(1.0);
  CncState cnc;
  cnc.connected = true;
  cnc.stamp = Workshop::START + 1.0;
  cnc.spindle_speed = units::radPerSecFromRpm(RPM);
  shop.listener.push(cnc);
  EXPECT_EQ(shop.state().speed, cnc.spindle_speed);
  shop.cut(2.5, RPM, {873.0});
  // Another speed is another cut.
  cnc.stamp += 2.5;
  cnc.spindle_speed = units::radPerSecFromRpm(7000.0);
  shop.listener.push(cnc);
  shop.cut(2.5, 7000.0);
  shop.idle(1.0, 7000.0);
  ASSERT_EQ(shop.state().tries.size(), 2u);
  EXPECT_EQ(shop.state().tries[0].kind, Kind::chatter);
  EXPECT_NEAR(units::rpmFromRadPerSec(shop.state().tries[1].speed), 7000.0, 7.0);
  EXPECT_EQ(shop.state().tries[1].kind, Kind::stable) << shop.state().tries[1].text;
}

TEST(SoundListener, withoutARangeTheSpeedsAreAroundTheFirst) {
  SoundParameters p = parameters();
  p.speed_low = p.speed_high = p.speed = 0.0;  // the speed is found from the harmonics
  Workshop shop(p);
  shop.idle(2.0);
  shop.cut(2.5, RPM, {873.0});
  shop.idle(1.0);
  ASSERT_EQ(shop.state().tries.size(), 1u);
  EXPECT_NEAR(units::rpmFromRadPerSec(shop.state().tries[0].speed), RPM, 6.0);
  ASSERT_FALSE(shop.state().advice.speeds.empty());
  for (const SpeedProposal& proposal : shop.state().advice.speeds) {
    EXPECT_GT(units::rpmFromRadPerSec(proposal.speed), 0.499 * RPM);
    EXPECT_LT(units::rpmFromRadPerSec(proposal.speed), 2.001 * RPM);
  }
}

TEST(SoundListener, restartAndDiscardForgetTries) {
  Workshop shop(parameters());
  shop.idle(2.0);
  shop.cut(2.5, RPM, {873.0});
  shop.idle(1.0);
  shop.cut(2.5, RPM);
  shop.idle(1.0);
  ASSERT_EQ(shop.state().tries.size(), 2u);
  EXPECT_TRUE(shop.state().advice.speeds.empty());  // stable
  CutSetting setting;
  setting.discard_last = true;
  shop.listener.set(setting);
  shop.idle(0.1);
  EXPECT_EQ(shop.state().tries.size(), 1u);
  EXPECT_FALSE(shop.state().advice.speeds.empty());
  setting = {};
  setting.teeth = 3;  // another tool
  shop.listener.set(setting);
  EXPECT_EQ(shop.state().teeth, 3);
  EXPECT_TRUE(shop.state().tries.empty());
  EXPECT_TRUE(shop.state().advice.speeds.empty());
}

// A tool that has not the stated number of teeth: chatter is never called stable.
TEST(SoundListener, aWrongNumberOfTeethDoesNotMakeChatterStable) {
  for (const int teeth : {1, 3, 4, 5}) {
    SoundParameters p = parameters();
    p.teeth = teeth;
    Workshop shop(p);
    shop.idle(2.0);
    shop.cut(3.0, RPM, {873.0});
    shop.idle(1.0);
    for (const SoundTry& t : shop.state().tries) EXPECT_NE(t.kind, Kind::stable) << teeth << ' ' << t.text;
  }
}

TEST(SoundListener, withoutTeethNothingIsJudged) {
  SoundParameters p = parameters();
  p.teeth = 0;
  Workshop shop(p);
  shop.idle(2.0);
  shop.cut(2.5, RPM, {873.0});
  shop.idle(1.0);
  EXPECT_TRUE(shop.state().tries.empty());
  EXPECT_EQ(shop.lines.back(), "a cut was heard; it is judged when the number of teeth is set");
}

TEST(SpeedAdvice, anUnsureCutThatProbablyChattersIsUsed) {
  SoundTry unsure;
  unsure.speed = units::radPerSecFromRpm(RPM);
  unsure.kind = Kind::unsure;
  unsure.frequency = 873.0;
  unsure.probability = 0.6;
  SoundTry sure = unsure;
  sure.kind = Kind::chatter;
  const SpeedRange range{0.5 * unsure.speed, 2.0 * unsure.speed};
  const SpeedAdvice advice = adviseSpeeds(TEETH, range, {unsure});
  ASSERT_FALSE(advice.speeds.empty());
  EXPECT_TRUE(advice.used[0]);
  EXPECT_EQ(advice.speeds[0].speed, adviseSpeeds(TEETH, range, {sure}).speeds[0].speed);
  unsure.probability = 0.4;
  EXPECT_TRUE(adviseSpeeds(TEETH, range, {unsure}).speeds.empty());
}

TEST(SoundListener, refusesInvalidSettings) {
  SoundListener listener(parameters());
  const auto refused = [&](const CutSetting& setting) { EXPECT_THROW(listener.set(setting), Error); };
  CutSetting setting;
  setting.teeth = 41;
  refused(setting);
  setting = {};
  setting.range = SpeedRange{900.0, 400.0};
  refused(setting);
  setting = {};
  setting.speed = units::radPerSecFromRpm(20000.0);  // beyond the range
  refused(setting);
  setting.speed = NAN;
  refused(setting);
  EXPECT_EQ(listener.state().teeth, TEETH);
  SoundParameters p = parameters();
  p.speed_high = 0.0;
  EXPECT_THROW(SoundListener{p}, Error);
}

}  // namespace
}  // namespace smartmill::stability
