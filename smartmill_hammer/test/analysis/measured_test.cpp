#include <algorithm>
#include <cmath>
#include <complex>
#include <fstream>
#include <functional>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/io/uff.h"
#include "smartmill_core/modal/modal_estimate.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_hammer/analysis/tap_records.h"

namespace smartmill::hammer {
namespace {

// The one mode nearest to a published frequency [Hz].
const EstimatedMode& nearest(const ModalEstimate& estimate, double expected) {
  return *std::min_element(estimate.modes.begin(), estimate.modes.end(),
                           [expected](const auto& a, const auto& b) {
                             return std::abs(a.frequency - expected) < std::abs(b.frequency - expected);
                           });
}

void expectFinite(const ModalEstimate& estimate) {
  for (const auto* modes : {&estimate.modes, &estimate.doubts}) {
    for (const EstimatedMode& m : *modes) {
      EXPECT_TRUE(std::isfinite(m.frequency_std) && m.frequency_std > 0.0);
      EXPECT_TRUE(std::isfinite(m.damping_ratio_std) && m.damping_ratio_std > 0.0);
      for (const double std : m.gain_std) EXPECT_TRUE(std::isfinite(std) && std > 0.0);
    }
  }
}

// Published: modes at 1074, 1961, 2617 Hz; the features near 1265 and 2713 Hz are smaller.
TEST(MeasuredToolTip, ShowsThePublishedModes) {
  SMARTMILL_SHARED_DATA(file, "measured/tool_tip_tap/EMA_Point_1_Channel_1_CH1.txt");
  ASSERT_EQ(detectFormat(file), TapFormat::frf);
  for (const bool whole : {false, true}) {
    ModalEstimateOptions options;
    if (!whole) options.low = 500.0, options.high = 3500.0;
    const ModalEstimate estimate = estimateModes({readFrfText(file)}, options);
    ASSERT_GE(estimate.modes.size(), 3u);
    EXPECT_LE(estimate.modes.size(), 10u);
    for (const double expected : {1074.0, 1961.0, 2617.0}) {
      const EstimatedMode& found = nearest(estimate, expected);
      EXPECT_NEAR(found.frequency, expected, 0.01 * expected);
      EXPECT_GT(found.gain[0], 0.0);
    }
    // The shoulder next to the third mode is a mode of its own; that near 1265 Hz is not proven by one point.
    EXPECT_NEAR(nearest(estimate, 2713.0).frequency, 2713.0, 0.01 * 2713.0);
    expectFinite(estimate);
  }
}

TEST(MeasuredToolTip, AllPointsShareThePublishedModes) {
  SMARTMILL_SHARED_DATA(folder, "measured");
  std::vector<FrequencyResponse> frfs = {readFrfText(folder + "/tool_tip_tap/EMA_Point_1_Channel_1_CH1.txt")};
  for (int i = 2; i <= 5; ++i)
    frfs.push_back(readFrfText(folder + "/tool_tip_points/point_" + std::to_string(i) + ".txt"));
  ModalEstimateOptions options;
  options.low = 500.0;
  options.high = 3500.0;
  const ModalEstimate estimate = estimateModes(frfs, options);
  for (const double expected : {1074.0, 1961.0, 2617.0})
    EXPECT_NEAR(nearest(estimate, expected).frequency, expected, 0.01 * expected);
  // No pair of cancelling modes: one mode within 4 % of the first.
  EXPECT_EQ(std::count_if(estimate.modes.begin(), estimate.modes.end(),
                          [](const EstimatedMode& m) { return std::abs(m.frequency - 1074.0) < 43.0; }),
            1);
  // Signs of the mode shapes along the tool: equal at all points in the first mode, not in the second.
  const EstimatedMode &first = nearest(estimate, 1074.0), &second = nearest(estimate, 1961.0);
  for (std::size_t o = 1; o < 5; ++o) EXPECT_GT(first.gain[o] * first.gain[0], 0.0);
  EXPECT_LT(second.gain[4] * second.gain[0], 0.0);
  expectFinite(estimate);
}

// Engineering Vibration Toolbox: one mode each between 156 and 312 Hz.
TEST(MeasuredVibrationToolbox, OneModeEach) {
  SMARTMILL_SHARED_DATA(folder, "measured/vt_cases");
  const double expected[] = {212.0925, 192.5938};
  for (const int i : {0, 1}) {
    ModalEstimateOptions options;
    options.low = 156.0;
    options.high = 312.0;
    const ModalEstimate estimate =
        estimateModes({readFrfText(folder + "/case" + std::to_string(i + 1) + ".txt")}, options);
    ASSERT_EQ(estimate.modes.size(), 1u) << i;
    EXPECT_NEAR(estimate.modes[0].frequency, expected[i], 5e-4 * expected[i]);
    expectFinite(estimate);
  }
}

// The single hit of the same point: within 5 % of the averaged receptance's Im at the published modes.
TEST(MeasuredToolTip, SingleHitAgreesWithTheAverage) {
  SMARTMILL_SHARED_DATA(file, "measured/tool_tip_tap/ImpactTesting_Point1_Channel1_CH1.txt");
  ASSERT_EQ(detectFormat(file), TapFormat::text);
  const TapFrf frf = averageTaps({readTapText(file)}, {});
  EXPECT_NEAR(frf.receptance.at(1074.0).imag(), -0.6433e-6, 0.05 * 0.6433e-6);
  EXPECT_NEAR(frf.receptance.at(1961.0).imag(), -0.2138e-6, 0.05 * 0.2138e-6);
  EXPECT_NEAR(frf.receptance.at(2617.0).imag(), -0.2180e-6, 0.05 * 0.2180e-6);
}

// H1 of five hits: no hit rejected, and poles at the peaks that the record's description lists.
TEST(MeasuredFiveHits, GiveOnePoleSet) {
  SMARTMILL_SHARED_DATA(folder, "measured/five_hits");
  std::vector<TapRecord> taps;
  for (int i = 1; i <= 5; ++i) taps.push_back(readTapCsv(folder + "/hit_" + std::to_string(i) + ".csv"));
  EXPECT_EQ(detectFormat(taps[0].file), TapFormat::csv);
  EXPECT_DOUBLE_EQ(taps[0].hit.sample_rate, 25600.0);
  const TapFrf frf = averageTaps(taps, {});
  for (const TapVerdict& hit : frf.hits) EXPECT_TRUE(hit.accepted()) << hit.reason;
  EXPECT_EQ(frf.measured.averages, 5);
  EXPECT_EQ(frf.measured.unit, "m/s2/N");
  ModalEstimateOptions options;
  options.low = 500.0;
  options.high = 6500.0;
  const ModalEstimate estimate = estimateModes({frf.receptance}, options);
  for (const double expected : {810.0, 900.0, 2640.0, 3669.0, 3690.0, 4093.0, 4128.0, 4164.0, 4392.0, 5969.0})
    EXPECT_NEAR(nearest(estimate, expected).frequency, expected, 4.0);
  expectFinite(estimate);
}

// A hit and an FRF through a universal file, response before force, and acceleration in g; a DynoWare export.
TEST(TapRecords, ReadUniversalFilesAndDynoWare) {
  const TemporaryFolder temporary;
  const std::string file = temporary.file("smartmill_tap.uff");
  UffFunction force, response, frf;
  force.type = response.type = uff::TIME_RESPONSE;
  force.numerator = uff::EXCITATION_FORCE;
  force.unit = "N";
  response.numerator = uff::ACCELERATION;
  response.unit = "g";
  std::string dynoware = "DynoWare,Version 2.5\nTime,Ax,Hammer\ns,m/s2,N\n";
  for (int i = 0; i < 64; ++i) {
    force.abscissa.push_back(1e-4 * i);
    response.abscissa.push_back(1e-4 * i);
    force.value.emplace_back(i == 10 ? 50.0 : 0.0);
    response.value.emplace_back(0.5 * i);
    dynoware += std::to_string(1e-4 * i) + "," + std::to_string(i) + "," + (i == 10 ? "50" : "0") + "\n";
  }
  frf.type = uff::FREQUENCY_RESPONSE;
  frf.numerator = uff::ACCELERATION;
  frf.denominator = uff::EXCITATION_FORCE;
  frf.unit = "m/s2";
  for (int i = 0; i < 8; ++i) {
    frf.abscissa.push_back(10.0 * i);
    frf.value.emplace_back(2.0, -1.0);
  }
  writeUff({response, force}, file, true);
  ASSERT_EQ(detectFormat(file), TapFormat::uff);
  const TapFile hit = readTapFile(file, TapFormat::uff, {});
  ASSERT_EQ(hit.taps.size(), 1u);
  EXPECT_EQ(hit.taps[0].kind, ResponseKind::acceleration);
  EXPECT_DOUBLE_EQ(hit.taps[0].hit.sample_rate, 10000.0);
  EXPECT_DOUBLE_EQ(hit.taps[0].hit.force[10], 50.0);
  EXPECT_NEAR(hit.taps[0].hit.response[2], 9.80665, 1e-12);
  writeUff({frf}, file, false);
  const TapFile lines = readTapFile(file, TapFormat::uff, {});
  ASSERT_EQ(lines.frfs.size(), 1u);
  EXPECT_EQ(lines.frfs[0].frf.unit, "m/N");
  ASSERT_EQ(lines.frfs[0].frf.size(), 7u);  // none at rest
  const double square = std::pow(2.0 * 3.14159265358979 * 10.0, 2);
  EXPECT_NEAR(std::abs(lines.frfs[0].frf.value[0] + std::complex<double>(2.0, -1.0) / square), 0.0, 1e-15);
  std::ofstream(file) << dynoware;
  ASSERT_EQ(detectFormat(file), TapFormat::dynoware);
  const TapFile channels = readTapFile(file, TapFormat::dynoware, {});
  ASSERT_EQ(channels.taps.size(), 1u);
  EXPECT_EQ(channels.taps[0].kind, ResponseKind::acceleration);
  EXPECT_DOUBLE_EQ(channels.taps[0].hit.force[10], 50.0);
  EXPECT_DOUBLE_EQ(channels.taps[0].hit.response[7], 7.0);
}

TEST(TapRecords, ErrorsNameTheFault) {
  const auto message = [](const std::string& text, const std::function<void(const std::string&)>& read) {
    const TemporaryFolder temporary;
    const std::string file = temporary.file("smartmill_tap.csv");
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
  // Too short to be checked
  EXPECT_NE(message("time[s],hammer[N],acceleration[m/s2]\n0,1,1\n0.1,1,1\n",
                    [](const std::string& f) {
                      const TapFrf none = averageTaps({readTapCsv(f)}, {});
                      throw Error(none.hits.front().reason);
                    })
                .find("2 samples"),
            std::string::npos);
  EXPECT_NE(message("hello\n", [](const std::string& f) { detectFormat(f); }).find("neither"),
            std::string::npos);
}

}  // namespace
}  // namespace smartmill::hammer
