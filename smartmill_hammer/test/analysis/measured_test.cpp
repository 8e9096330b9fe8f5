#include <cmath>
#include <fstream>
#include <functional>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_hammer/analysis/tap_records.h"

namespace smartmill {
namespace hammer {
namespace {

// Published: modes at 1074, 1961, 2617 Hz; Im of the averaged receptance there -.6433, -.2138, -.2180 um/N.
void expectPublished(const std::vector<ModeReading>& rows) {
  const double due[][2] = {{1074.0, -0.6433e-6}, {1961.0, -0.2138e-6}, {2617.0, -0.2180e-6}};
  for (const auto& d : due) {
    const ModeReading* nearest = nullptr;
    for (const ModeReading& row : rows) {
      if (!nearest || std::abs(row.mode.frequency - d[0]) < std::abs(nearest->mode.frequency - d[0]))
        nearest = &row;
    }
    ASSERT_NE(nearest, nullptr);
    EXPECT_NEAR(nearest->mode.frequency, d[0], 0.01 * d[0]);
    EXPECT_NEAR(nearest->receptance.imag(), d[1], 0.05 * std::abs(d[1])) << d[0];
    EXPECT_GT(nearest->mode.gain, 0.0);
  }
}

TEST(MeasuredToolTip, ShowsThePublishedModes) {
  SMARTMILL_SHARED_DATA(file, "measured/tool_tip_tap/EMA_Point_1_Channel_1_CH1.txt");
  ASSERT_EQ(detectFormat(file), TapFormat::frf);
  const FrequencyResponse frf = readFrfText(file);
  EXPECT_TRUE(looksDirect(frf, 500.0, 3500.0));
  expectPublished(peakModes(frf, 500.0, 3500.0, 0.02, 20));
}

// The single hit of the same point: within 5 % of the averaged receptance's Im at the published modes.
TEST(MeasuredToolTip, SingleHitAgreesWithTheAverage) {
  SMARTMILL_SHARED_DATA(file, "measured/tool_tip_tap/ImpactTesting_Point1_Channel1_CH1.txt");
  ASSERT_EQ(detectFormat(file), TapFormat::text);
  const TapFrf frf = averageTaps({readTapText(file)}, {20.0, 0.1, 0.0}, 0.0);
  EXPECT_NEAR(frf.receptance.at(1074.0).imag(), -0.6433e-6, 0.05 * 0.6433e-6);
  EXPECT_NEAR(frf.receptance.at(1961.0).imag(), -0.2138e-6, 0.05 * 0.2138e-6);
  EXPECT_NEAR(frf.receptance.at(2617.0).imag(), -0.2180e-6, 0.05 * 0.2180e-6);
}

TEST(MeasuredFiveHits, ShowThePublishedPeaks) {
  SMARTMILL_SHARED_DATA(folder, "measured/five_hits");
  std::vector<TapRecord> taps;
  for (int i = 1; i <= 5; ++i) taps.push_back(readTapCsv(folder + "/hit_" + std::to_string(i) + ".csv"));
  EXPECT_EQ(detectFormat(taps[0].file), TapFormat::csv);
  EXPECT_DOUBLE_EQ(taps[0].hit.sample_rate, 25600.0);
  const TapFrf frf = averageTaps(taps, {20.0, 0.1, 0.0}, 0.0);
  EXPECT_EQ(frf.measured.averages, 5);
  EXPECT_EQ(frf.measured.unit, "m/s2/N");
  const auto peaks = findPeaks(frf.measured, 500.0, 6500.0, 0.02);
  for (const double due : {810.0, 900.0, 2640.0, 3669.0, 3690.0, 4093.0, 4128.0, 4164.0, 4392.0, 5969.0}) {
    double nearest = 1e9;
    for (const double p : peaks) nearest = std::abs(p - due) < std::abs(nearest - due) ? p : nearest;
    EXPECT_NEAR(nearest, due, 3.0);
  }
}

TEST(TapRecords, NameWhatIsWrong) {
  const auto message = [](const std::string& text, const std::function<void(const std::string&)>& read) {
    const std::string file = testing::TempDir() + "smartmill_tap.csv";
    std::ofstream(file) << text;
    try {
      read(file);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const auto csv = [](const std::string& f) { readTapCsv(f); };
  EXPECT_NE(message("time[s],acceleration[m/s2]\n0,1\n0.1,1\n", csv).find("hammer"), std::string::npos);
  EXPECT_NE(message("time[s],hammer[N]\n0,1\n0.1,1\n", csv).find("acceleration or displacement"),
            std::string::npos);
  EXPECT_NE(message("time[s],hammer[N],acceleration[m/s2]\n0,1,nan\n0.1,1,1\n", csv).find("line 2"),
            std::string::npos);
  EXPECT_NE(message("0 1 2\n0.1 1\n", [](const std::string& f) { readTapText(f); }).find("line 2"),
            std::string::npos);
  EXPECT_NE(message("hello\n", [](const std::string& f) { detectFormat(f); }).find("neither"),
            std::string::npos);
}

}  // namespace
}  // namespace hammer
}  // namespace smartmill
