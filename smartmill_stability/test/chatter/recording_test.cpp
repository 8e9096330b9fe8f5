#include "smartmill_stability/chatter/recording.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr double RATE = 16000.0, SPEED = 6000.0 * units::TWO_PI / 60.0;
constexpr int TEETH = 2;  // tooth passing frequency 200 Hz

struct Tone {
  double frequency, size;
};

/// One second of air, two of cut, one of air; noise with unit variance.
Recording recording(const std::vector<Tone>& in_cut, const std::vector<Tone>& always, bool air = true) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  Recording r;
  r.sample_rate = RATE;
  r.channels.resize(1);
  for (int i = 0; i < static_cast<int>((air ? 4.0 : 2.0) * RATE); ++i) {
    const double t = i / RATE;
    const bool cut = !air || (t >= 1.0 && t < 3.0);
    double v = normal(random);
    for (const Tone& tone : always) v += tone.size * std::sin(units::TWO_PI * tone.frequency * t);
    for (const Tone& tone : in_cut) v += cut ? tone.size * std::sin(units::TWO_PI * tone.frequency * t) : 0.0;
    r.channels[0].push_back(v);
  }
  return r;
}

RecordingRequest request() {
  RecordingRequest r;
  r.speed = SPEED;
  r.teeth = TEETH;
  return r;
}

const std::vector<Tone> TOOTH_PASSING{{200.0, 3.0}, {400.0, 2.0}, {600.0, 2.0}, {800.0, 1.0}};

std::vector<Tone> with(std::vector<Tone> more) {
  more.insert(more.end(), TOOTH_PASSING.begin(), TOOTH_PASSING.end());
  return more;
}

TEST(Recording, linesOneToothPassingApartDuringTheCutAreChatter) {
  const RecordingVerdict v =
      judgeRecording(recording(with({{873.0, 3.0}, {673.0, 1.0}, {1073.0, 1.0}}), {}), request());
  EXPECT_TRUE(v.cut);
  EXPECT_TRUE(v.chatter()) << v.text();
  EXPECT_NEAR(v.frequency, 873.0, 1.0);
  EXPECT_EQ(v.companions, 2);
  EXPECT_GT(v.over_air, 20.0);
  EXPECT_NEAR(v.from, 1.0, 0.3);
  EXPECT_NEAR(v.to, 3.0, 0.3);
}

TEST(Recording, timesIncludeTheStartOfTheRecording) {
  Recording r = recording(with({{873.0, 3.0}, {673.0, 1.0}, {1073.0, 1.0}}), {});
  const RecordingVerdict at_zero = judgeRecording(r, request());
  r.start = 7.5;
  const RecordingVerdict later = judgeRecording(r, request());
  EXPECT_DOUBLE_EQ(later.from, at_zero.from + 7.5);
  EXPECT_DOUBLE_EQ(later.to, at_zero.to + 7.5);
  EXPECT_DOUBLE_EQ(later.spectrogram.time.front(), at_zero.spectrogram.time.front() + 7.5);
}

TEST(Recording, harmonicsAreNoChatter) {
  const RecordingVerdict v =
      judgeRecording(recording(with({{100.0, 1.0}, {300.0, 1.0}, {900.0, 2.0}}), {}), request());
  EXPECT_TRUE(v.cut);
  EXPECT_FALSE(v.chatter()) << v.text();
}

TEST(Recording, aToneOutsideTheCutIsNoChatter) {
  const std::vector<Tone> other{{873.0, 2.0}, {1746.0, 1.0}, {1231.0, 2.0}};
  EXPECT_FALSE(judgeRecording(recording(TOOTH_PASSING, other), request()).chatter());
  // Without air it is identified by the lack of companions.
  EXPECT_FALSE(judgeRecording(recording(TOOTH_PASSING, other, false), request()).chatter());
}

TEST(Recording, theHarmonicsCorrectAWrongSpeed) {
  RecordingRequest wrong = request();
  wrong.speed = 1.012 * SPEED;
  const RecordingVerdict stable = judgeRecording(recording(with({{1200.0, 2.0}, {1800.0, 2.0}}), {}), wrong);
  EXPECT_NEAR(stable.speed / SPEED, 1.0, 1e-3);
  EXPECT_FALSE(stable.chatter()) << stable.text();
}

TEST(Recording, withKnownModesChatterLiesNearOne) {
  RecordingRequest known = request();
  known.modes = {840.0};
  const Recording r = recording(with({{873.0, 3.0}, {673.0, 1.0}, {1073.0, 1.0}}), {});
  EXPECT_TRUE(judgeRecording(r, known).chatter());
  EXPECT_EQ(judgeRecording(r, known).mode, 840.0);
  known.modes = {2500.0};
  EXPECT_FALSE(judgeRecording(r, known).chatter());
}

TEST(Recording, noiseAloneIsNoCut) {
  const RecordingVerdict v = judgeRecording(recording({}, {}), request());
  EXPECT_FALSE(v.cut);
  EXPECT_EQ(v.text(), "no cut: no louder part and no lines at the tooth passing frequency");
}

// Orders 1, 3 and 5 of the spindle and those of the teeth determine the speed.
TEST(Recording, theSpeedIsFoundFromTheHarmonics) {
  RecordingRequest unknown = request();
  unknown.speed = 0.0;
  const std::vector<Tone> runout{{100.0, 1.0}, {300.0, 1.0}, {500.0, 0.5}};
  std::vector<Tone> tones = with(runout);
  const RecordingVerdict stable = judgeRecording(recording(tones, {}), unknown);
  EXPECT_EQ(stable.kind, RecordingVerdict::Kind::stable) << stable.text();
  EXPECT_EQ(stable.speed_source, RecordingVerdict::SpeedSource::found);
  EXPECT_NEAR(stable.speed / SPEED, 1.0, 1e-3);
  tones.insert(tones.end(), {{873.0, 3.0}, {673.0, 1.0}, {1073.0, 1.0}});
  const RecordingVerdict chatter = judgeRecording(recording(tones, {}), unknown);
  EXPECT_TRUE(chatter.chatter()) << chatter.text();
  EXPECT_NEAR(chatter.speed / SPEED, 1.0, 1e-3);
  // A stated speed that the harmonics contradict is replaced.
  RecordingRequest wrong = request();
  wrong.speed = 1.37 * SPEED;
  const RecordingVerdict corrected = judgeRecording(recording(with(runout), {}), wrong);
  EXPECT_EQ(corrected.speed_source, RecordingVerdict::SpeedSource::corrected) << corrected.text();
  EXPECT_NEAR(corrected.speed / SPEED, 1.0, 1e-3);
}

/// Part of a recording, from its middle. @param turns revolutions
Recording partOf(Recording whole, double turns) {
  std::vector<double>& channel = whole.channels[0];
  const auto middle = channel.begin() + static_cast<std::ptrdiff_t>(channel.size() / 2);
  channel = std::vector<double>(middle, middle + static_cast<std::ptrdiff_t>(turns * RATE / 100.0));
  return whole;
}

TEST(Recording, fewRevolutionsAreJudgedWithLessCertainty) {
  const Recording chatter = recording(with({{873.0, 8.0}, {673.0, 3.0}, {1073.0, 3.0}}), {});
  const Recording stable = recording(with({{1200.0, 2.0}}), {});
  for (const double turns : {4.0, 8.0, 16.0, 30.0}) {
    const RecordingVerdict v = judgeRecording(partOf(chatter, turns), request());
    EXPECT_GE(v.spectrogram.time.size(), 2u);  // of a picture
    EXPECT_TRUE(v.chatter() || v.kind == RecordingVerdict::Kind::unsure) << turns << ' ' << v.text();
    EXPECT_NE(judgeRecording(partOf(stable, turns), request()).kind, RecordingVerdict::Kind::chatter)
        << turns;
  }
  EXPECT_TRUE(judgeRecording(partOf(chatter, 30.0), request()).chatter());
}

// 2.7 samples in a tooth passing period: harmonics from 400 Hz on are aliased.
TEST(Recording, aliasedHarmonicsAreNoChatter) {
  const auto slow = [](const std::vector<Tone>& tones) {
    Recording r;
    r.sample_rate = 540.0;
    r.channels.resize(1);
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 3 * 540; ++i) {
      double v = 0.3 * normal(random);
      for (const Tone& tone : tones) v += tone.size * std::sin(units::TWO_PI * tone.frequency * i / 540.0);
      r.channels[0].push_back(v);
    }
    return r;
  };
  RecordingRequest exact = request();
  exact.speed_error = 0.0;
  const RecordingVerdict stable = judgeRecording(slow(TOOTH_PASSING), exact);
  EXPECT_EQ(stable.kind, RecordingVerdict::Kind::stable) << stable.text();
  const RecordingVerdict chatter = judgeRecording(slow(with({{237.0, 6.0}, {37.0, 2.0}})), exact);
  EXPECT_TRUE(chatter.chatter()) << chatter.text();
  EXPECT_NEAR(chatter.frequency, 237.0, 1.0);
}

// The orders of an idle spindle, and a bearing modulated by the revolution.
TEST(Recording, anIdleSpindleWithABearingIsNoChatter) {
  const std::vector<Tone> idle{{100.0, 2.0}, {200.0, 0.5}, {300.0, 2.0}, {400.0, 0.5},
                               {500.0, 1.0}, {531.0, 3.0}, {431.0, 1.0}, {631.0, 1.0}};
  const RecordingVerdict v = judgeRecording(recording(idle, {}, false), request());
  EXPECT_NE(v.kind, RecordingVerdict::Kind::chatter) << v.text();
  EXPECT_NE(v.kind, RecordingVerdict::Kind::stable) << v.text();
}

// Where chatter coincides with a spindle harmonic the recording does not distinguish it.
TEST(Recording, chatterAtASpindleHarmonicIsUnsure) {
  const RecordingVerdict v = judgeRecording(recording(with({{900.0, 20.0}}), {}), request());
  EXPECT_EQ(v.kind, RecordingVerdict::Kind::unsure) << v.text();
}

// What the idle machine does as well is no chatter; without the recording of it the bearing is one.
TEST(Recording, anIdleRecordingShowsWhatIsNoChatter) {
  const std::vector<Tone> idle{{100.0, 0.5}, {300.0, 0.5}, {531.0, 2.0}, {431.0, 1.0}, {731.0, 1.0}};
  std::vector<Tone> tones = with(idle);
  RecordingRequest known = request();
  known.idle = recording(idle, {}, false);
  const RecordingVerdict stable = judgeRecording(recording(tones, {}, false), known);
  EXPECT_EQ(stable.kind, RecordingVerdict::Kind::stable) << stable.text();
  EXPECT_EQ(judgeRecording(known.idle, known).kind, RecordingVerdict::Kind::no_cut);
  tones.push_back({873.0, 6.0});
  const RecordingVerdict chatter = judgeRecording(recording(tones, {}, false), known);
  EXPECT_TRUE(chatter.chatter()) << chatter.text();
  EXPECT_NEAR(chatter.frequency, 873.0, 1.0);
  EXPECT_GT(chatter.over_air, 10.0);
  known.idle.sample_rate = 8000.0;
  EXPECT_THROW(judgeRecording(recording(tones, {}, false), known), Error);
}

// Turning at 720 rpm: chatter of 152 Hz is 12.7 revolutions, and one of 144.3 Hz next to the twelfth
// harmonic.
TEST(Recording, turningHasOneEdge) {
  RecordingRequest turning;
  turning.speed = units::TWO_PI * 12.0;
  turning.teeth = 1;
  const std::vector<Tone> revolution{{12.0, 1.0}, {24.0, 0.5}, {96.0, 0.5}};
  const auto cut = [&](double frequency, double size, double turns) {
    std::vector<Tone> tones = revolution;
    tones.push_back({frequency, size});
    Recording whole = recording(tones, {}, false);
    whole.channels[0].resize(static_cast<std::size_t>(turns * RATE / 12.0));
    return judgeRecording(whole, turning);
  };
  EXPECT_TRUE(cut(152.0, 8.0, 24.0).chatter() ||
              cut(152.0, 8.0, 24.0).kind == RecordingVerdict::Kind::unsure);
  // The speed of few revolutions fits itself to the chatter: it is not called stable.
  for (const double turns : {6.0, 11.0, 18.0})
    for (const double frequency : {144.3, 152.0})
      EXPECT_NE(cut(frequency, 8.0, turns).kind, RecordingVerdict::Kind::stable)
          << turns << ' ' << cut(frequency, 8.0, turns).text();
}

TEST(Recording, refusesInvalidRecordingsAndRequests) {
  Recording brief = recording({}, {});
  brief.channels[0].resize(400);  // 2.5 revolutions
  EXPECT_THROW(judgeRecording(brief, request()), Error);
  EXPECT_THROW(judgeRecording(Recording(), request()), Error);
  RecordingRequest wrong = request();
  wrong.teeth = 0;
  EXPECT_THROW(judgeRecording(recording({}, {}), wrong), Error);
  wrong = request();
  wrong.speed = 100.0 * SPEED;
  EXPECT_THROW(judgeRecording(recording({}, {}), wrong), Error);
}

}  // namespace
}  // namespace smartmill::stability
