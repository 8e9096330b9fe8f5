#include "smartmill_discrepancy/recordings/path_campaign.h"

#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/campaign/slow_channels.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using units::MM;
using units::PI;

constexpr double RATE = 1000.0;                        // [Hz]
constexpr double SPEED = 50.0 * units::TWO_PI;         // [rad/s] 3000 rpm
constexpr std::array<double, 3> ZERO{{100, 50, -20}};  // [mm]
constexpr double FEED = 10.0;                          // [mm/s]

/// With a tool of 20 mm a slot along x, then a step of 5 mm along -x, then air.
constexpr const char* SHOULDER =
    "G21 G90 G17 S3000 M3 F600\n"
    "G0 X-15 Y15 Z5\n"
    "G1 Z-2\n"
    "G1 X75\n"
    "G1 Y20\n"
    "G1 X-15\n"
    "G0 Z5\n"
    "M30\n";
const std::vector<std::array<double, 3>> POINTS{{{-15, 15, 5}}, {{-15, 15, -2}}, {{75, 15, -2}},
                                                {{75, 20, -2}}, {{-15, 20, -2}}, {{-15, 20, 5}}};

/// A tool that moves along POINTS at the programmed feed. fx states the time, so that a slice of the record
/// states where it was taken from.
Record shoulderRecord() {
  Record record;
  std::vector<double> x, y, z;
  const auto add = [&](const std::array<double, 3>& at) {
    x.push_back((at[0] + ZERO[0]) * MM);
    y.push_back((at[1] + ZERO[1]) * MM);
    z.push_back((at[2] + ZERO[2]) * MM);
  };
  for (std::size_t k = 0; k + 1 < POINTS.size(); ++k) {
    const auto &from = POINTS[k], &to = POINTS[k + 1];
    const double length = std::hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
    const auto samples = static_cast<int>(std::round(length / FEED * RATE));
    for (int i = 0; i < samples; ++i) {
      const double share = static_cast<double>(i) / samples;
      add({from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1]),
           from[2] + share * (to[2] - from[2])});
    }
  }
  std::vector<double> angle, time;
  for (std::size_t i = 0; i < x.size(); ++i) {
    time.push_back(static_cast<double>(i) / RATE);
    angle.push_back(std::fmod(SPEED * time.back(), units::TWO_PI));
  }
  record.time = record.add("fx") = time;
  record.add("fy").assign(x.size(), 1.0);
  record.add("fz").assign(x.size(), 2.0);
  record.add("spindle_angle") = angle;
  record.add("axis_x") = x;
  record.add("axis_y") = y;
  record.add("axis_z") = z;
  return record;
}

/// Axis positions of the record where it states a time.
std::array<double, 3> toolAt(double time) {
  static const Record record = shoulderRecord();
  const auto i = static_cast<std::size_t>(std::round(time * RATE));
  return {record.column("axis_x")[i] / MM - ZERO[0], record.column("axis_y")[i] / MM - ZERO[1],
          record.column("axis_z")[i] / MM - ZERO[2]};
}

class Production : public ::testing::Test {
 protected:
  Production() {
    MachineModel model = smartmill::mill();
    model.force_sensor.noise_rms.reset();  // the stability limit is not evaluated
    Workpiece workpiece{"6061", {}, {}};
    for (std::size_t a = 0; a < 3; ++a) {
      workpiece.low[a] = ZERO[a] * MM - (a == 2 ? 10.0 * MM : 0.0);
      workpiece.high[a] = ZERO[a] * MM + (a == 2 ? 0.0 : a == 1 ? 40.0 * MM : 60.0 * MM);
    }
    model.workpiece = workpiece;
    writeMachineModel(model, folder_.file("model.yaml"));
    folder_.write("part.nc", SHOULDER);
    writeCsv(shoulderRecord(), folder_.file("part.csv"), 9);
    writeYaml("[100, 50, -20]");
  }
  void writeYaml(const std::string& zero, const std::string& more = "") {
    folder_.write("campaign.yaml",
                  "format: smartmill-campaign/1\nmodel: model.yaml\ntests:\n"
                  "- {name: part, kind: path, file: part.csv, sample_rate_hz: 1000, program: part.nc,\n"
                  "   start_time_s: 100, cut_time_before_s: 30, program_zero_mm: " +
                      zero + "}\n" + more);
  }
  Campaign cuts() {
    const Campaign campaign = readCampaignWithPaths(folder_.file(""));
    return campaignOfPaths(campaign, campaign.modelPath(), folder_.file("cuts"),
                           [&](const std::string& line) { lines_.push_back(line); });
  }

  TemporaryFolder folder_;
  std::vector<std::string> lines_;
};

// Slot: 0 to 180 degrees. The step along -x leaves the wall on the left: the tool has cut y < 25, so that of
// its 20 mm a strip of 5 mm is left on its right, cos(exit) = (5 - 10) / 10 from the side of y.
TEST_F(Production, givesTheCutsOfTheProgram) {
  const Campaign campaign = cuts();
  std::map<double, const CampaignTest*> by_feed;  // [rad] direction
  for (const CampaignTest& test : campaign.tests)
    if (test.kind == TestKind::cut) by_feed[std::abs(test.feed_direction)] = &test;
  ASSERT_EQ(by_feed.size(), 2u);
  const double feed_per_tooth = FEED * MM / (50.0 * 4);
  const CampaignTest& slot = *by_feed.begin()->second;
  EXPECT_NEAR(slot.feed_direction, 0.0, 1e-9);
  EXPECT_NEAR(slot.engagement->entry, 0.0, 0.01);
  EXPECT_NEAR(slot.engagement->exit, PI, 0.01);
  const CampaignTest& step = *by_feed.rbegin()->second;
  EXPECT_NEAR(std::abs(step.feed_direction), PI, 1e-9);
  // Immersion angles count from the left of the feed, here -y: the strip is on the right.
  EXPECT_NEAR(step.engagement->entry, std::acos((5.0 - 10.0) / 10.0), 0.02);
  EXPECT_NEAR(step.engagement->exit, PI, 0.01);
  for (const CampaignTest* test : {&slot, &step}) {
    EXPECT_NEAR(test->engagement->axial_depth, 2.0 * MM, 1e-6);
    EXPECT_NEAR(test->engagement->feed_per_tooth, feed_per_tooth, 0.002 * feed_per_tooth);
    EXPECT_NEAR(test->spindle_speed, SPEED, 1e-4 * SPEED);
    EXPECT_EQ(test->sample_rate, RATE);
    const Record record = readRecord(campaign, *test);
    EXPECT_NEAR(static_cast<double>(record.size()), 0.3 * RATE, 0.02 * RATE);
    // The slice is that of its start time, and the tool was where the cut is.
    const double begin = record.column("fx").front(), end = record.column("fx").back();
    EXPECT_NEAR(*test->start_time, 100.0 + begin, 1e-6);
    EXPECT_NEAR(end - begin, record.time.back(), 1e-6);
    const double y = test == &slot ? 15.0 : 20.0;
    for (const double time : {begin, end}) {
      EXPECT_NEAR(toolAt(time)[1], y, 1e-6);
      EXPECT_GT(toolAt(time)[0], 0.0);
      EXPECT_LT(toolAt(time)[0], 60.0);
    }
    EXPECT_NEAR(std::remainder(record.column("spindle_angle").front() - SPEED * begin, units::TWO_PI), 0.0,
                1e-3);
  }
  // In cut since the edge of the stock at x = 0 was 10 mm ahead, after 1.2 s of the descent.
  const double in_cut = readRecord(campaign, slot).column("fx").front() - (7.0 + 5.0) / FEED;
  EXPECT_NEAR(*slot.cut_time_before, 30.0 + in_cut, 0.1);
  EXPECT_THAT(lines_.front(), HasSubstr("part: "));
  EXPECT_THAT(lines_.front(), HasSubstr("steady cuts along part.nc"));
}

// The load meter of a path has its own rate: its values are those of the slice's times.
TEST_F(Production, keepsALoadMeterOfItsOwnRate) {
  std::string load = "time[s],load_meter[V]\n";
  for (int i = 0; i < 1000; ++i) load += formatted("%.2f,%.3f\n", 0.02 * i, 0.02 * i);  // [V] the time
  folder_.write("load.csv", load);
  MachineModel model = readMachineModel(folder_.file("model.yaml"));
  model.spindle->load_meter_full_scale = 100.0;
  writeMachineModel(model, folder_.file("model.yaml"));
  writeYaml("[100, 50, -20]",
            "slow_channels:\n- {test: part, channel: load_meter, file: load.csv, sample_rate_hz: 50}\n");
  const Campaign campaign = cuts();
  const std::vector<SlowChannel> slow = readSlowChannels(campaign);
  ASSERT_EQ(slow.size(), campaign.tests.size());
  for (std::size_t k = 0; k < slow.size(); ++k) {
    const Record record = readRecord(campaign, slow[k]);
    const double begin = *campaign.tests[k].start_time - 100.0;
    for (std::size_t i = 0; i < record.size(); ++i)
      EXPECT_NEAR(record.column("load_meter")[i], begin + record.time[i], 0.02);
  }
}

TEST_F(Production, keepsTheOtherTests) {
  folder_.write("tap.csv", "time[s],hammer[N],displacement[m]\n0,0,0\n0.001,1,0\n");
  folder_.write("load.csv", "time[s],load_meter[V]\n0,0.1\n0.1,0.1\n");
  folder_.write("air.csv", "time[s],fx[N],fy[N],fz[N]\n0,0,0,0\n0.001,1,0,0\n");
  writeYaml("[100, 50, -20]",
            "- {name: tap, kind: tap, file: tap.csv, sample_rate_hz: 1000, direction: y}\n"
            "- {name: air, kind: air, file: air.csv, sample_rate_hz: 1000, spindle_speed_rpm: 3000}\n"
            "slow_channels:\n"
            "- {test: air, channel: load_meter, file: load.csv, sample_rate_hz: 10}\n");
  const Campaign campaign = cuts();
  ASSERT_GE(campaign.tests.size(), 4u);
  const CampaignTest& tap = campaign.tests[campaign.tests.size() - 2];
  EXPECT_EQ(tap.direction, "y");
  EXPECT_EQ(readRecord(campaign, tap).column("hammer")[1], 1.0);
  const std::vector<SlowChannel> slow = readSlowChannels(campaign);
  ASSERT_FALSE(slow.empty());
  EXPECT_EQ(slow.back().test, "air");
  EXPECT_EQ(readRecord(campaign, slow.back()).column("load_meter")[1], 0.1);
}

TEST_F(Production, refusesWhatItCannotFollow) {
  writeYaml("[100, 52, -20]");
  EXPECT_THAT(errorOf([&] { cuts(); }),
              AllOf(HasSubstr("part.csv: no steady cut; the positions are on the path of part.nc in "),
                    HasSubstr("expected a distance below 0.2 mm (program_zero_mm)")));
  writeYaml("[100, 50, -20]");
  folder_.write("part.nc", "G21 G90\nG99999\nM30\n");
  EXPECT_THAT(errorOf([&] { cuts(); }), HasSubstr("part.nc: line 2"));
  folder_.write("part.nc", "G21 G90 G17 S3000 M3 F600\nG0 X-15 Y15 Z5\nG1 X75\nM30\n");
  EXPECT_THAT(errorOf([&] { cuts(); }), HasSubstr("part.nc"));
  folder_.write("part.nc", SHOULDER);
  MachineModel model = smartmill::mill();
  writeMachineModel(model, folder_.file("model.yaml"));
  EXPECT_THAT(errorOf([&] { cuts(); }), HasSubstr("model.yaml: workpiece is missing"));
}

}  // namespace
}  // namespace smartmill::discrepancy
