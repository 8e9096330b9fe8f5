// sound.launch with a sound server of the test: the monitor of its null sink is the microphone.
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Log.h>
#include <smartmill_msgs/SoundAdvice.h>

#include "launched.h"
#include "session/child.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill {
namespace {

using smartmill_msgs::SoundAdvice;
using ::testing::HasSubstr;

constexpr double RATE = 48000.0, REVOLUTION = 100.0, TOOTH = 200.0, CHATTER = 873.0;  // [Hz]

/// A program that runs until stop().
class Running {
 public:
  Running(const std::vector<std::string>& command, const std::string& log)
      : thread_([this, command, log] {
          session::runChild(command, log, [this] { return stopped_.load(); });
          ended_ = true;
        }) {}
  ~Running() { stop(); }
  void stop() {
    stopped_ = true;
    if (thread_.joinable()) thread_.join();
  }
  bool ended() const { return ended_; }

 private:
  std::atomic<bool> stopped_{false}, ended_{false};
  std::thread thread_;
};

/// Sound of four seconds of an idle spindle, a cut that chatters, and two seconds more. @param cut [s]
void writeSound(const std::string& file, double cut) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::ofstream out(file, std::ios::binary);
  for (int i = 0; i < static_cast<int>((6.0 + cut) * RATE); ++i) {
    const double t = i / RATE;
    const auto tone = [t](double frequency, double size) {
      return size * std::sin(units::TWO_PI * frequency * t);
    };
    double v = 0.01 * normal(random);
    for (const int k : {1, 3, 5}) v += tone(k * REVOLUTION, 0.01);
    if (t > 4.0 && t < 4.0 + cut) {
      for (int k = 1; k <= 5; ++k) v += tone(k * TOOTH, 0.06 / k);
      for (int k = -1; k <= 1; ++k) v += tone(CHATTER + k * TOOTH, k == 0 ? 0.06 : 0.02);
    }
    const auto sample = static_cast<float>(v);
    out.write(reinterpret_cast<const char*>(&sample), sizeof sample);
  }
}

TEST(Sound, aMicrophoneAloneGivesTheNextSpeedAndNoSoundIsStored) {
  for (const char* program : {"/usr/bin/pulseaudio", "/usr/bin/pacat"})
    if (::access(program, X_OK) != 0) GTEST_SKIP() << "./setup --with-instruments installs PulseAudio";
  const TemporaryFolder folder;
  const std::string port = testing::freePort(), socket = folder.file("native");
  for (const char* variable : {"HOME", "XDG_RUNTIME_DIR", "PULSE_RUNTIME_PATH", "ROS_HOME"})
    setenv(variable, folder.file("").c_str(), 1);
  setenv("ROS_HOSTNAME", "localhost", 1);
  setenv("ROS_MASTER_URI", ("http://localhost:" + port).c_str(), 1);
  std::ofstream(folder.file("microphone.yaml"))
      << "format: smartmill-instrument/1\nname: microphone\ndriver: sound\n"
         "options: {source: converter.monitor, channels: 1, server: 'unix:" +
             socket +
             "'}\nsample_rate: 48000.0\nstreams:\n  - topic: daq/sound\n    channels:\n"
             "      - {input: 1, name: sound, unit: \"1\", sensitivity: 1.0, range: 1.0}\n";
  writeSound(folder.file("cut.raw"), 3.0);
  writeSound(folder.file("long_cut.raw"), 40.0);
  Running server({"/usr/bin/pulseaudio", "-n", "--daemonize=no", "--exit-idle-time=-1", "--use-pid-file=no",
                  "--disable-shm=yes", "-L",
                  "module-null-sink sink_name=converter rate=48000 channels=1 format=float32le", "-L",
                  "module-native-protocol-unix socket=" + socket + " auth-anonymous=1"},
                 folder.file("server.log"));
  ASSERT_TRUE(eventually([&] { return ::access(socket.c_str(), F_OK) == 0; }));
  const std::string log = folder.file("launch.log");
  Running graph({"roslaunch", "-p", port, "smartmill_launch", "sound.launch",
                 "instrument:=" + folder.file("microphone.yaml"), "teeth:=2", "low:=4000", "high:=12000",
                 "panel:=false", "bag:=" + folder.file("sound.bag")},
                log);
  int argc = 0;
  ros::init(argc, nullptr, "sound_test", ros::init_options::NoSigintHandler);
  ASSERT_TRUE(eventually([] { return ros::master::check(); })) << testing::contentOf(log);
  ros::NodeHandle nh;
  SoundAdvice last;
  const auto subscriber = nh.subscribe<SoundAdvice>(names::absolute(names::SOUND_ADVICE), 100,
                                                    [&](const SoundAdvice::ConstPtr& m) { last = *m; });
  std::vector<std::string> silence;  // from the log topic: nodes buffer what they print
  const auto log_subscriber =
      nh.subscribe<rosgraph_msgs::Log>("/rosout_agg", 1000, [&](const rosgraph_msgs::Log::ConstPtr& m) {
        if (m->msg.find("no sound:") != std::string::npos) silence.push_back(m->msg);
      });
  const auto until = [](const auto& condition) { return eventually(condition, [] { ros::spinOnce(); }); };
  ASSERT_TRUE(until([&] { return last.state == SoundAdvice::IDLE; })) << testing::contentOf(log);
  std::vector<std::string> player{"/usr/bin/pacat",     "--playback",   "--server=unix:" + socket,
                                  "--device=converter", "--rate=48000", "--channels=1",
                                  "--format=float32le", "--raw",        folder.file("cut.raw")};
  // The sound is played again while a busy computer has lost a part of it: then the cut is not judged.
  const auto chattering = [&] {
    return std::find_if(last.tries.begin(), last.tries.end(), [](const smartmill_msgs::SoundTry& one) {
      return one.kind == smartmill_msgs::SoundTry::CHATTER;
    });
  };
  const auto advised = [&] {
    return chattering() != last.tries.end() && !last.running && !last.next_speed.empty();
  };
  for (int plays = 0; plays < 5 && !advised(); ++plays) {
    const Running playing(player, folder.file("player.log"));
    until([&] { return playing.ended() || advised(); });
    if (!advised()) until([&] { return last.state == SoundAdvice::IDLE && !last.running; });
  }
  ASSERT_TRUE(advised()) << last.text << testing::contentOf(log);
  for (const smartmill_msgs::SoundTry& one : last.tries)
    EXPECT_NE(one.kind, smartmill_msgs::SoundTry::STABLE) << one.text;
  EXPECT_NEAR(chattering()->frequency, CHATTER, 1.0);
  EXPECT_NEAR(chattering()->spindle_speed, units::TWO_PI * REVOLUTION, 0.01 * units::TWO_PI * REVOLUTION);
  EXPECT_GT(last.next_stable.at(0), 0.1);

  // Unplugged in the cut.
  const std::size_t before = last.tries.size();
  player.back() = folder.file("long_cut.raw");  // longer than a busy computer needs to judge a part of it
  Running again(player, folder.file("player.log"));
  ASSERT_TRUE(until([&] { return last.tries.size() > before; })) << last.text;
  silence.clear();  // a busy computer may have lost sound before
  server.stop();
  ASSERT_TRUE(until([&] { return last.state == SoundAdvice::NO_SOUND && !silence.empty(); }));
  ASSERT_TRUE(until([&] { return !last.running; }));  // the cut is judged to its end
  again.stop();
  graph.stop();
  ASSERT_EQ(silence.size(), 1u);
  EXPECT_THAT(silence[0], HasSubstr("no sound: daq/sound: no samples for 1 s, in a cut"));

  RecordingReader recording(folder.file("sound.bag"));
  EXPECT_TRUE(recording.has(names::SOUND_ADVICE));
  EXPECT_TRUE(recording.has(names::SOUND_FEATURES));
  EXPECT_FALSE(recording.has(names::SOUND));
}

}  // namespace
}  // namespace smartmill
