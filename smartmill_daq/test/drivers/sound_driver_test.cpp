// A PulseAudio server of the test with a null sink, whose monitor is the converter.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "smartmill_core/formatted.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_daq_testing/child.h"
#include "smartmill_daq_testing/listening.h"

namespace smartmill::daq {
namespace {

using testing::Child;
using ::testing::HasSubstr;
using testing::Listening;

constexpr int PLAYED = 48000;  // [1] samples, 1 s
// The server may cut the first and last fragments of what is played.
constexpr int EXPECTED = 43200;

bool isBuilt() {
  for (const DriverKind& kind : driverKinds())
    if (kind.name == "sound") return static_cast<bool>(kind.make);
  return false;
}

class SoundDriver : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!isBuilt() || ::access("/usr/bin/pulseaudio", X_OK) != 0 || ::access("/usr/bin/pacat", X_OK) != 0)
      GTEST_SKIP() << "./setup --with-instruments installs PulseAudio";
    environment_ = {"HOME=" + folder_.file(""), "XDG_RUNTIME_DIR=" + folder_.file(""),
                    "PULSE_RUNTIME_PATH=" + folder_.file("")};
    server_ = std::make_unique<Child>(
        std::vector<std::string>{
            "/usr/bin/pulseaudio", "-n", "--daemonize=no", "--exit-idle-time=-1", "--use-pid-file=no",
            "--disable-shm=yes", "-L",
            "module-null-sink sink_name=converter rate=48000 channels=2 format=float32le", "-L",
            "module-native-protocol-unix socket=" + folder_.file("native") + " auth-anonymous=1"},
        environment_, folder_.file("log"));
    for (int i = 0; i < 600 && ::access(folder_.file("native").c_str(), F_OK) != 0; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }

  std::string description(const std::string& rate, const std::string& source,
                          const std::string& channels) const {
    return "format: smartmill-instrument/1\nname: sound\ndriver: sound\nsample_rate: " + rate +
           "\noptions: {source: " + source + ", channels: " + channels +
           ", server: 'unix:" + folder_.file("native") +
           "'}\nstreams:\n  - topic: daq/vibration\n    channels:\n"
           "      - {input: 2, name: y, unit: m/s2, sensitivity: 0.01, range: 2.0}\n"
           "      - {input: 1, name: x, unit: m/s2, sensitivity: 0.01, range: 2.0}\n";
  }

  TemporaryFolder folder_;
  std::vector<std::string> environment_;
  std::unique_ptr<Child> server_;
};

// The left channel counts, so that every sample says which one it is.
TEST_F(SoundDriver, whatIsPlayedArrivesToTheBit) {
  Listening listening(folder_.file("sound.yaml"), description("48000.0", "converter.monitor", "2"));
  ASSERT_TRUE(listening.until([&] { return !listening.blocks.empty(); })) << folder_.file("log");
  {
    std::ofstream raw(folder_.file("raw"), std::ios::binary);
    for (int i = 1; i <= PLAYED; ++i) {
      const float left = static_cast<float>(i) / 65536.0F, right = -0.5F * left;
      raw.write(reinterpret_cast<const char*>(&left), sizeof left);
      raw.write(reinterpret_cast<const char*>(&right), sizeof right);
    }
  }
  const Child player(
      {"/usr/bin/pacat", "--playback", "--server=unix:" + folder_.file("native"), "--device=converter",
       "--rate=48000", "--channels=2", "--format=float32le", "--no-remix", "--raw", folder_.file("raw")},
      environment_);
  std::vector<double> left, right;
  std::size_t read = 0;
  const auto done = [&] {
    for (; read < listening.blocks.size(); ++read) {
      const SampleBlock& block = listening.blocks[read];
      for (std::size_t i = 0; i < block.size(); ++i) {
        if (block.at(i, 1) == 0.0) continue;  // silence
        left.push_back(block.at(i, 1));
        right.push_back(block.at(i, 0));
      }
    }
    return left.size() >= static_cast<std::size_t>(EXPECTED);
  };
  ASSERT_TRUE(listening.until(done)) << left.size() << " samples";
  // 2 V of range and 0.01 V/(m/s2): 200 m/s2 at full scale.
  const int first = static_cast<int>(std::lround(left[0] * 65536.0 / 200.0));
  EXPECT_LE(first, PLAYED - EXPECTED);
  for (int i = 0; i < EXPECTED; ++i) {
    ASSERT_EQ(left[static_cast<std::size_t>(i)], 200.0 * (first + i) / 65536.0) << i;
    ASSERT_EQ(right[static_cast<std::size_t>(i)], -100.0 * (first + i) / 65536.0) << i;
  }
  EXPECT_EQ(listening.state().account.lost, 0u);

  server_->end();
  ASSERT_TRUE(listening.until([&] { return !listening.state().open; }));
  EXPECT_EQ(listening.faults.back().kind, FaultKind::unplugged);
  EXPECT_THAT(listening.faults.back().text, HasSubstr("source converter.monitor"));
}

TEST_F(SoundDriver, aServerThatWouldResampleIsRefused) {
  Listening listening(folder_.file("sound.yaml"), description("44100.0", "converter.monitor", "2"));
  EXPECT_THAT(errorOf([&] { listening.until([] { return false; }); }),
              HasSubstr("runs at 48000 Hz, sample_rate 44100 expected"));
  Listening mono(folder_.file("mono.yaml"), description("48000.0", "converter.monitor", "4"));
  EXPECT_THAT(errorOf([&] { mono.until([] { return false; }); }),
              HasSubstr("has 2 channels, options.channels 4 expected"));
  Listening absent(folder_.file("absent.yaml"), description("48000.0", "card", "2"));
  ASSERT_TRUE(absent.until([&] { return !absent.faults.empty(); }));
  EXPECT_THAT(absent.faults[0].text, HasSubstr("source card: not there"));
}

}  // namespace
}  // namespace smartmill::daq
