// sound_node hears the tones of an idle spindle, of a cut that chatters, and a microphone that stops.
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/SetSoundCut.h>
#include <smartmill_msgs/SoundAdvice.h>
#include <smartmill_msgs/SoundFeatures.h>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/follower.h"

namespace smartmill::stability {
namespace {

using smartmill_msgs::SetSoundCut;
using smartmill_msgs::SoundAdvice;

constexpr double RATE = 16000.0;
constexpr double REVOLUTION = 100.0, TOOTH = 200.0;  // [Hz] at 6000 rpm

class SoundNode : public ::testing::Test {
 protected:
  SoundNode()
      : microphone_(nh_.advertise<smartmill_msgs::SampleBlock>(names::SOUND, 0)),
        advice_(nh_.subscribe<SoundAdvice>(names::SOUND_ADVICE, 100,
                                           [this](const SoundAdvice::ConstPtr& m) { last_ = *m; })),
        features_(nh_.subscribe<smartmill_msgs::SoundFeatures>(
            names::SOUND_FEATURES, 100,
            [this](const smartmill_msgs::SoundFeatures::ConstPtr& m) { heard_.push_back(*m); })),
        diagnostics_(nh_.subscribe<diagnostic_msgs::DiagnosticArray>(
            "/diagnostics", 100, [this](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) {
              for (const auto& status : m->status)
                if (status.name.find(": sound") != std::string::npos) diagnosis_ = status.message;
            })) {}

  /// @param chatter [Hz] 0: none @param cut whether the teeth cut
  void play(double seconds, bool cut, double chatter) {
    constexpr std::size_t BLOCK = 160;
    for (auto left = static_cast<int>(seconds * RATE / BLOCK); left > 0; --left) {
      SampleBlock block;
      block.stamp = 1000.0 + static_cast<double>(index_) / RATE;
      block.sample_rate = RATE;
      block.first_index = index_;
      block.channels = {"sound"};
      block.units = {"1"};
      for (std::size_t i = 0; i < BLOCK; ++i) {
        const double t = static_cast<double>(index_++) / RATE;
        const auto tone = [t](double frequency, double size) {
          return size * std::sin(units::TWO_PI * frequency * t);
        };
        double v = 0.01 * normal_(random_);
        for (const int k : {1, 3, 5}) v += tone(k * REVOLUTION, 0.01);
        for (int k = 1; cut && k <= 5; ++k) v += tone(k * TOOTH, 0.06 / k);
        for (int k = -1; chatter > 0.0 && k <= 1; ++k) v += tone(chatter + k * TOOTH, k == 0 ? 0.06 : 0.02);
        block.samples.push_back(v);
      }
      node_.publish(microphone_, toMsg(block));
    }
  }

  template <class Condition>
  bool until(const Condition& condition) {
    return eventually([&] {
      ros::spinOnce();
      return condition();
    });
  }

  SetSoundCut::Response set(const SetSoundCut::Request& request) {
    SetSoundCut call;
    call.request = request;
    auto client = nh_.serviceClient<SetSoundCut>(names::SET_SOUND_CUT);
    EXPECT_TRUE(client.waitForExistence(ros::Duration(120.0)));
    EXPECT_TRUE(client.call(call));
    return call.response;
  }

  static SetSoundCut::Request unchanged() {
    SetSoundCut::Request request;
    request.speed_low = request.speed_high = request.spindle_speed = NAN;
    return request;
  }

  ros::NodeHandle nh_;
  ros::Publisher microphone_;
  ros::Subscriber advice_, features_, diagnostics_;
  SoundAdvice last_;
  std::vector<smartmill_msgs::SoundFeatures> heard_;
  std::string diagnosis_;
  Followers node_{{names::absolute("sound")}};
  std::uint64_t index_ = 0;
  std::mt19937_64 random_{3};
  std::normal_distribution<double> normal_;
};

TEST_F(SoundNode, hearsChatterAndProposesASpeedUntilTheMicrophoneStops) {
  node_.begin();
  node_.expect(microphone_);
  node_.expect(features_);
  SetSoundCut::Request request = unchanged();
  request.teeth = 2;
  request.spindle_speed = units::radPerSecFromRpm(6000.0);
  EXPECT_EQ(set(request).message, "2 teeth, next cut at 6000 rpm");
  request = unchanged();
  request.teeth = 60;
  EXPECT_EQ(set(request).code, SetSoundCut::Response::BAD_REQUEST);
  EXPECT_EQ(set(request).message, "teeth: 60: expected 1 to 40");

  play(2.0, false, 0.0);
  play(2.5, true, 873.0);
  play(1.0, false, 0.0);
  node_.settle();
  ASSERT_TRUE(until([&] { return last_.tries.size() == 1 && !last_.running && !last_.next_speed.empty(); }));
  EXPECT_EQ(last_.tries[0].kind, smartmill_msgs::SoundTry::CHATTER) << last_.tries[0].text;
  EXPECT_NEAR(last_.tries[0].frequency, 873.0, 1.0);
  EXPECT_TRUE(last_.tries[0].used);
  EXPECT_EQ(last_.unit, "1");
  EXPECT_EQ(last_.next_speed.size(), last_.next_stable.size());
  ASSERT_TRUE(until([&] { return heard_.size() >= 11; }));  // 5.5 s
  double loudest = 0.0, at = 0.0;
  for (std::size_t k = 0; k < heard_[6].amplitude.size(); ++k) {  // within the cut
    if (heard_[6].amplitude[k] < loudest) continue;
    loudest = heard_[6].amplitude[k];
    at = heard_[6].lowest + heard_[6].step * static_cast<double>(k);
  }
  EXPECT_TRUE(std::abs(at - 873.0) < 13.0 || std::abs(at - TOOTH) < 13.0) << at;

  request = unchanged();
  request.discard_last = true;
  EXPECT_EQ(set(request).code, SetSoundCut::Response::OK);
  ASSERT_TRUE(until([&] { return last_.tries.empty() && last_.next_speed.empty(); }));

  // No more samples: unplugged in the cut.
  play(1.5, true, 873.0);
  node_.leave();
  ASSERT_TRUE(until([&] { return last_.state == SoundAdvice::NO_SOUND; }));
  EXPECT_TRUE(std::isnan(last_.level));
  ASSERT_TRUE(until([&] { return last_.tries.size() == 1; }));  // what was heard of it
  EXPECT_EQ(last_.tries[0].kind, smartmill_msgs::SoundTry::CHATTER) << last_.tries[0].text;
  ASSERT_TRUE(until([&] {
    return diagnosis_.find("no sound: daq/sound: no samples for 1 s, in a cut") == 0;
  })) << diagnosis_;
}

}  // namespace
}  // namespace smartmill::stability

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "sound_node_test");
  return RUN_ALL_TESTS();
}
