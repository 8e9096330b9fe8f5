#include "smartmill_kalman/compensation/campaign_compensation.h"

#include <cmath>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/testing/sound_campaign.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace smartmill::kalman {
namespace {

/// The reference cut and nine taps as a campaign whose sensor agrees with its model.
class Measures : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    workpiece = GetParam();
    folder = std::filesystem::temp_directory_path() /
             (workpiece ? "smartmill_measures_workpiece" : "smartmill_measures_tool");
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    // Nothing of the section but `measures` may be used: the modes are wrong on purpose.
    std::ofstream(folder / "model.yaml")
        << "format: smartmill-model/1\nforce_sensor:\n  measures: "
        << (workpiece ? "force_on_workpiece" : "force_on_tool")
        << "\n  x: [{frequency_hz: 400.0, damping_ratio: 0.03, gain: 0.9}]\n";
    reference.spindle_speed = units::radPerSecFromRpm(9000.0);
    reference.duration = 0.4;
    record = simulate(reference);
    const double sign = workpiece ? -1.0 : 1.0;
    campaign.folder = folder.string();
    campaign.model_file = "model.yaml";
    Record cut;
    cut.time = record.time;
    for (const char* name : {"fx", "fy", "fz"}) cut.add(name).assign(record.time.size(), 0.0);
    for (std::size_t i = 0; i < record.time.size(); ++i) {
      cut.columns[0][i] = sign * record.measured[0][i];
      cut.columns[1][i] = sign * record.measured[1][i];
    }
    add("cut", TestKind::cut, cut, "");
    const ReferenceTaps taps = simulateTaps(reference, 3);
    for (const char* direction : {"x", "y"}) {
      for (std::size_t k = 0; k < taps.hammer.size(); ++k) {
        Record tap;
        for (std::size_t i = 0; i < taps.hammer[k].size(); ++i)
          tap.time.push_back(static_cast<double>(i) / reference.sample_rate);
        tap.add("hammer") = taps.hammer[k];
        for (const char* name : {"fx", "fy", "fz"}) tap.add(name).assign(tap.time.size(), 0.0);
        std::vector<double>& response = tap.columns[direction[0] == 'x' ? 1 : 2];
        for (std::size_t i = 0; i < tap.time.size(); ++i) response[i] = sign * taps.response[k][i];
        add(std::string("tap_") + direction + std::to_string(k), TestKind::tap, tap, direction);
      }
    }
  }
  void TearDown() override { std::filesystem::remove_all(folder); }
  void add(const std::string& name, TestKind kind, const Record& data, const char* direction) {
    writeCsv(data, (folder / (name + ".csv")).string());
    CampaignTest test;
    test.name = name;
    test.kind = kind;
    test.file = name + ".csv";
    test.sample_rate = reference.sample_rate;
    test.spindle_speed = reference.spindle_speed;
    test.direction = direction;
    campaign.tests.push_back(test);
  }

  bool workpiece = false;
  std::filesystem::path folder;
  ReferenceCase reference;
  ReferenceRecord record;
  Campaign campaign;
};

// With --identify the modes come from the taps and the sense from `measures`: force on the tool comes out,
// whatever the sensor shows, to 1.5 % (identified sensor).
TEST_P(Measures, IdentifiedSensorGivesTheForceOnTheTool) {
  EXPECT_EQ(measuresWorkpiece(campaign, ""), workpiece);
  const auto sensor = identifySensor(campaign, {100.0, 5000.0, 4});
  ASSERT_EQ(sensor[0].modes.size(), 3u);
  EXPECT_NEAR(sensor[0].modes[0].frequency, 1450.0, 3.0);
  EXPECT_NEAR(sensor[0].staticGain(), 1.0, 1e-9);
  Record cut = readRecord(campaign, campaign.tests[0]);
  if (measuresWorkpiece(campaign, "")) negateForces(cut);
  const auto force = compensate(cut, sensor, false, reference.spindle_speed, reference.sample_rate, {});
  for (std::size_t axis = 0; axis < 2; ++axis)
    EXPECT_LT(
        bandError(force[axis], record.truth[axis], reference.sample_rate, 3072, force[axis].size(), 5000.0),
        0.015);
}

INSTANTIATE_TEST_SUITE_P(Sensor, Measures, testing::Bool());

// Taps in WAV files, the hammer among their channels, give the same sensor.
TEST(SoundFiles, TapsTellTheSameSensor) {
  SMARTMILL_SHARED_DATA(folder, "campaigns/none");
  const Campaign campaign = readCampaign(folder);
  const TemporaryFolder wav;
  const Campaign sound =
      asSoundFiles(campaign, wav.file(""), [](const CampaignTest& t) { return t.kind == TestKind::tap; });
  const SensorFitParameters fit;
  const auto expected = identifySensor(campaign, fit), found = identifySensor(sound, fit);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    ASSERT_EQ(found[axis].modes.size(), expected[axis].modes.size());
    for (std::size_t m = 0; m < expected[axis].modes.size(); ++m) {
      EXPECT_NEAR(found[axis].modes[m].frequency, expected[axis].modes[m].frequency, 0.1);
      EXPECT_NEAR(found[axis].modes[m].gain, expected[axis].modes[m].gain, 1e-3);
    }
  }
}

}  // namespace
}  // namespace smartmill::kalman
