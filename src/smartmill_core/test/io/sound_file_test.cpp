#include "smartmill_core/io/sound_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "smartmill_core/campaign/sound_record.h"
#include "smartmill_core/cutting/lobe_flanks.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

std::string path(const char* name) {
  static const TemporaryFolder folder;
  return folder.file(name);
}

SoundFile tone() {
  SoundFile sound;
  sound.sample_rate = 8000.0;
  sound.channels.resize(2);
  for (int i = 0; i < 4000; ++i) {
    sound.channels[0].push_back(0.5 * std::sin(0.1 * i));
    sound.channels[1].push_back(-0.25);
  }
  return sound;
}

TEST(SoundFile, readsBackWhatWasWritten) {
  const std::string file = path("tone.wav");
  writeWav(tone(), file);
  const SoundFile back = readSoundFile(file);
  EXPECT_EQ(back.sample_rate, 8000.0);
  ASSERT_EQ(back.channels.size(), 2u);
  ASSERT_EQ(back.channels[0].size(), 4000u);
  for (std::size_t i = 0; i < 4000; ++i)
    EXPECT_NEAR(back.channels[0][i], tone().channels[0][i], 2e-7);  // 24 bits
  EXPECT_TRUE(isSoundFile("A.WAV"));
  EXPECT_FALSE(isSoundFile("a.csv"));
}

TEST(SoundFile, rejectsOtherFilesInOneLine) {
  const std::string file = path("none.wav");
  std::ofstream(file) << "time[s],fx[N]\n";
  for (const std::string& bad : {file, path("missing.wav")}) {
    try {
      readSoundFile(bad);
      FAIL();
    } catch (const Error& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
      EXPECT_NE(std::string(e.what()).find(bad), std::string::npos);
    }
  }
}

TEST(SoundFile, channelsBecomeQuantities) {
  const std::string file = path("hits.wav");
  writeWav(tone(), file);
  const Record record = readSoundRecord(file, soundChannels("1:hammer=2000,2:acceleration=-400"));
  EXPECT_NEAR(record.column("hammer")[5], 1000.0 * std::sin(0.5), 1e-3);
  EXPECT_NEAR(record.column("acceleration")[5], 100.0, 1e-3);
  EXPECT_DOUBLE_EQ(record.time[8], 1e-3);
  EXPECT_EQ(soundChannels("3:fx")[0].scale, 1.0);
  for (const char* bad : {"", "hammer=3", "0:hammer", "1:=3", "1:hammer=0", "1:hammer=x", "1hammer"})
    EXPECT_THROW(soundChannels(bad), Error) << bad;
  EXPECT_THROW(readSoundRecord(file, soundChannels("3:hammer")), Error);
  EXPECT_THROW(readSoundRecord(file, soundChannels("1:loudness")), Error);
}

// A lobe that rises by 1 mm over 100 rad/s and falls by 1 mm over 50 rad/s.
TEST(LobeFlanks, areLinearBetweenTheChartsSpeeds) {
  const StabilityLimit limit{{900.0, 1000.0, 1050.0, 1100.0}, {1e-3, 2e-3, 1e-3, 1e-3}, {}};
  const auto room = lobeFlanks(limit, 1000.0, 1.5e-3);
  EXPECT_NEAR(room[0], 50.0, 1e-9);
  EXPECT_NEAR(room[1], 25.0, 1e-9);
  EXPECT_EQ(lobeFlanks(limit, 900.0, 1.5e-3)[0], 0.0);
  EXPECT_NEAR(lobeFlanks(limit, 1000.0, 0.5e-3)[0], 100.0, 1e-9);
  EXPECT_NEAR(lobeFlanks(limit, 1000.0, 0.5e-3)[1], 100.0, 1e-9);
  EXPECT_NEAR(lobeFlanks(limit, 980.0, 1.5e-3)[1], 45.0, 1e-9);
}

}  // namespace
}  // namespace smartmill
