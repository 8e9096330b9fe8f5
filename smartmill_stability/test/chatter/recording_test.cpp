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

TEST(Recording, refusesInvalidRecordingsAndRequests) {
  Recording brief = recording({}, {});
  brief.channels[0].resize(500);
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
