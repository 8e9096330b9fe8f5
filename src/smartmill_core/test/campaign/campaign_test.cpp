#include "smartmill_core/campaign/campaign.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/campaign/slow_channels.h"
#include "smartmill_core/campaign/stream_offset.h"
#include "smartmill_core/cutting/regression.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/testing/refusals.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using ::testing::HasSubstr;

constexpr const char* CAMPAIGN = R"(format: smartmill-campaign/1
model: model.yaml
tests:
- name: slot
  kind: cut
  file: slot.csv
  sample_rate_hz: 100
  spindle_speed_rpm: 4500.0
  feed_per_tooth_mm: 0.06
  axial_depth_mm: 2.0
  entry_deg: 0.0
  exit_deg: 180.0
  feed_direction_deg: -90
  engage_time_s: 0.02
  start_time_s: 405.0
  cut_time_before_s: 20.0
- {name: air, kind: air, file: air.csv, sample_rate_hz: 100, spindle_speed_rpm: 1000, running_before_s: 0.4}
- {name: tap, kind: tap, file: tap.csv, sample_rate_hz: 100, spindle_speed_rpm: 0, direction: z}
)";

void expectCampaign(const Campaign& c, const std::string& folder) {
  ASSERT_EQ(c.tests.size(), 3u);
  EXPECT_EQ(c.modelPath(), folder + "/model.yaml");
  EXPECT_EQ(c.pathOf(c.tests[0]), folder + "/slot.csv");
  EXPECT_EQ(c.tests[0].kind, TestKind::cut);
  EXPECT_DOUBLE_EQ(c.tests[0].spindle_speed, 150.0 * units::PI);
  EXPECT_DOUBLE_EQ(c.tests[0].engagement->feed_per_tooth, 6e-5);
  EXPECT_DOUBLE_EQ(c.tests[0].engagement->exit, units::PI);
  EXPECT_DOUBLE_EQ(c.tests[0].feed_direction, -0.5 * units::PI);
  EXPECT_DOUBLE_EQ(*c.tests[0].engage_time, 0.02);
  EXPECT_EQ(c.tests[1].kind, TestKind::air);
  EXPECT_FALSE(c.tests[1].start_time);
  EXPECT_FALSE(c.tests[0].running_before);
  EXPECT_DOUBLE_EQ(*c.tests[1].running_before, 0.4);
  EXPECT_EQ(c.tests[2].direction, "z");
  EXPECT_EQ(c.tests[2].spindle_speed, 0.0);
}

const char* const SLOW =
    "slow_channels:\n- {test: air, channel: load_meter, file: load.csv, sample_rate_hz: 50}\n";

// A channel with its own sample rate has its own file; files without one are read as before.
TEST(Campaign, channelsMayHaveTheirOwnSampleRate) {
  const TemporaryFolder folder;
  folder.write("campaign.yaml", CAMPAIGN);
  EXPECT_TRUE(readSlowChannels(readCampaign(folder.file("."))).empty());
  folder.write("campaign.yaml", CAMPAIGN + std::string(SLOW));
  folder.write("load.csv", "time[s],load_meter[V]\n0.013,0.1\n0.033,0.1\n0.053,0.103\n");
  const Campaign campaign = readCampaign(folder.file("."));
  std::vector<SlowChannel> slow = readSlowChannels(campaign);
  ASSERT_EQ(slow.size(), 1u);
  EXPECT_EQ(slow[0].test, "air");
  const Record readings = readRecord(campaign, slow[0]);
  EXPECT_DOUBLE_EQ(readings.time.front(), 0.013);
  EXPECT_DOUBLE_EQ(readings.column("load_meter").at(2), 0.103);

  const std::string copy = folder.file("copy");
  writeCampaign(campaign, slow, copy);
  slow = readSlowChannels(readCampaign(copy));
  ASSERT_EQ(slow.size(), 1u);
  EXPECT_EQ(slow[0].file, "load.csv");
  EXPECT_DOUBLE_EQ(slow[0].sample_rate, 50.0);
}

TEST(Campaign, rejectsSlowChannelsWithoutATest) {
  const TemporaryFolder folder;
  const auto refuses = [&](const char* entry, const char* message) {
    folder.write("campaign.yaml", CAMPAIGN + std::string("slow_channels:\n- {") + entry + "}\n");
    try {
      readCampaign(folder.file("."));
      ADD_FAILURE() << entry;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
  };
  refuses("test: none, channel: load_meter, file: a.csv, sample_rate_hz: 50", "'none' is not a test");
  refuses("test: tap, channel: load_meter, file: a.csv, sample_rate_hz: 50", "is a tap");
  refuses("test: air, channel: fx, file: a.csv, sample_rate_hz: 50", "'fx'");
  refuses("test: air, channel: load_meter, file: ../a.csv, sample_rate_hz: 50", "outside");
  refuses("test: air, channel: load_meter, file: a.csv, sample_rate_hz: 0", "sample_rate_hz");
  refuses("test: air, channel: load_meter, file: a.csv, sample_rate_hz: 50, unit: V", "unit");
}

// One pulse per revolution at 1000 rpm: 10 V below the threshold of 5 V once in 60 ms.
TEST(Campaign, makesTheSpindleAngleOfATachometer) {
  const TemporaryFolder folder;
  const std::string header =
      "format: smartmill-campaign/1\nmodel: model.yaml\ntests:\n"
      "- {name: air, kind: air, file: air.csv, sample_rate_hz: 1000, spindle_speed_rpm: 1000";
  std::string csv = "time[s],fx[N],tachometer[V]\n";
  for (int i = 0; i < 500; ++i) csv += formatted("%.3f,0,%d\n", 1e-3 * i, i % 60 < 10 ? 0 : 10);
  folder.write("air.csv", csv);
  folder.write("campaign.yaml",
               header + ", tachometer: {threshold_v: 5, hysteresis_v: 2, edge: falling, angle_deg: 90}}\n");
  const Campaign campaign = readCampaign(folder.file("."));
  const Record record = readRecord(campaign, campaign.tests[0]);
  EXPECT_FALSE(record.has("tachometer"));
  const std::vector<double>& angle = record.column("spindle_angle");
  for (std::size_t i = 0; i < angle.size(); ++i) {
    // The pulse is half a sample before the first low sample.
    const double turned = units::TWO_PI * (static_cast<double>(i) + 0.5) / 60.0 + 0.5 * units::PI;
    EXPECT_NEAR(std::remainder(angle[i] - turned, units::TWO_PI), 0.0, 1e-6) << i;
  }
  writeCampaign(campaign, folder.file("copy"));
  const CampaignTest again = readCampaign(folder.file("copy")).tests[0];
  ASSERT_TRUE(again.tachometer);
  EXPECT_DOUBLE_EQ(again.tachometer->threshold, 5.0);
  EXPECT_TRUE(again.tachometer->falling);
  EXPECT_NEAR(again.tachometer->angle, 0.5 * units::PI, 1e-9);

  const auto refusal = [&](const std::string& key) {
    folder.write("campaign.yaml", header + ", tachometer: " + key + "}\n");
    try {
      const Campaign bad = readCampaign(folder.file("."));
      readRecord(bad, bad.tests[0]);
      return std::string();
    } catch (const Error& error) {
      return std::string(error.what());
    }
  };
  EXPECT_THAT(refusal("{threshold_v: 50}"), HasSubstr("air.csv: column tachometer: 0 pulses through 50 V"));
  EXPECT_THAT(refusal("{pulses_per_revolution: 1.5}"), HasSubstr("pulses_per_revolution"));
  EXPECT_THAT(refusal("{volt: 1}"), HasSubstr("volt"));
  // Without the key the column is not used; with the key and without the column the record is refused.
  folder.write("campaign.yaml", header + "}\n");
  const Campaign without = readCampaign(folder.file("."));
  const Record unused = readRecord(without, without.tests[0]);
  EXPECT_FALSE(unused.has("spindle_angle"));
  EXPECT_EQ(unused.notes.size(), 1u);
  folder.write("air.csv", "time[s],fx[N]\n0,0\n0.001,0\n");
  EXPECT_THAT(refusal("{}"),
              HasSubstr("air.csv: column tachometer is missing (test air has key tachometer)"));
}

TEST(Campaign, readsAndWritesEveryKey) {
  const TemporaryFolder folder;
  folder.write("campaign.yaml", CAMPAIGN);
  const Campaign campaign = readCampaign(folder.file(""));
  expectCampaign(readCampaign(folder.file("campaign.yaml")),
                 folder.file("").substr(0, folder.file("").size() - 1));
  writeCampaign(campaign, folder.file("copy"));
  expectCampaign(readCampaign(folder.file("copy")), folder.file("copy"));
}

TEST(Campaign, errorsNameFileKeyAndValue) {
  const std::vector<Refusal> refusals{
      {"file: slot.csv", "file: ../slot.csv",
       "tests[0].file: '../slot.csv' lies outside the campaign's folder"},
      {"file: slot.csv", "file: /slot.csv", "tests[0].file: '/slot.csv' lies outside the campaign's folder"},
      {"name: air", "name: slot", "tests[1].name: 'slot' is the name of two tests"},
      {"kind: air", "kind: ari", "tests[1].kind: 'ari' is not one of cut | air | tap | move | path"},
      {"spindle_speed_rpm: 1000", "spindle_speed_rpm: 0",
       "tests[1].spindle_speed_rpm: 0 is out of range (> 0)"},
      {"exit_deg: 180.0", "exit_deg: 0", "tests[0].exit_deg: 0.0 is out of range (> entry_deg 0.0)"},
      {"exit_deg: 180.0", "exit_deg: 361", "tests[0].exit_deg: 361 is out of range (0 <= value <= 360)"},
      {"  axial_depth_mm: 2.0\n", "", "tests[0].axial_depth_mm: is missing"},
      {"sample_rate_hz: 100", "sample_rate_hz: fast", "tests[0].sample_rate_hz: 'fast' is not a number"},
      {"feed_direction_deg: -90", "feed_direction_deg: 400",
       "tests[0].feed_direction_deg: 400 is out of range (-360 <= value <= 360)"},
      {"direction: z", "direction: u", "tests[2].direction: 'u' is not one of x | y | z"},
      {"  engage_time_s: 0.02\n", "  engage_time_s: 0.02\n  running_before_s: 0.3\n",
       "tests[0].running_before_s: 0.3 contradicts engage_time_s"},
      {"kind: air,", "kind: air, depth: 2,", "tests[1].depth: unknown key (its value: '2')"},
      {"model: model.yaml\n", "", "model: is missing"},
      {"tests:", "runs:", "tests: is missing"},
  };
  expectRefusals(CAMPAIGN, refusals, readCampaign);
}

constexpr const char* PATHS = R"(format: smartmill-campaign/1
model: model.yaml
tests:
- {name: part, kind: path, file: part.csv, sample_rate_hz: 100, program: pocket.nc, start_time_s: 7,
   program_zero_mm: [10, -20, 5.5], tools: {2: drill.yaml, 1: model.yaml}}
- {name: second, kind: path, file: second.csv, sample_rate_hz: 100, program: other.nc, dialect: linuxcnc}
)";

TEST(Campaign, readsAndWritesPaths) {
  const TemporaryFolder folder;
  folder.write("campaign.yaml", PATHS);
  const auto expectPaths = [](const Campaign& campaign) {
    ASSERT_EQ(campaign.tests.size(), 2u);
    EXPECT_TRUE(hasPaths(campaign));
    EXPECT_EQ(campaign.tests[0].kind, TestKind::path);
    EXPECT_EQ(campaign.tests[0].start_time, 7.0);
    const PathProgram& program = campaign.tests[0].program.value();
    EXPECT_EQ(program.file, "pocket.nc");
    EXPECT_DOUBLE_EQ(program.zero[0], 0.01);
    EXPECT_DOUBLE_EQ(program.zero[1], -0.02);
    EXPECT_DOUBLE_EQ(program.zero[2], 5.5e-3);
    EXPECT_EQ(program.tools, (std::map<int, std::string>{{1, "model.yaml"}, {2, "drill.yaml"}}));
    EXPECT_FALSE(program.linuxcnc);
    EXPECT_TRUE(campaign.tests[1].program.value().tools.empty());
    EXPECT_TRUE(campaign.tests[1].program.value().linuxcnc);
  };
  const Campaign campaign = readCampaignWithPaths(folder.file("."));
  expectPaths(campaign);
  writeCampaign(campaign, folder.file("copy"));
  expectPaths(readCampaignWithPaths(folder.file("copy")));
  expectRefusals(
      PATHS,
      {{", program: other.nc", "", "tests[1].program: is missing"},
       {"dialect: linuxcnc", "dialect: okuma", "tests[1].dialect: 'okuma' is not one of fanuc | linuxcnc"},
       {"other.nc", "../other.nc", "tests[1].program: '../other.nc' lies outside the campaign's folder"},
       {"2: drill", "two: drill", "tests[0].tools.two: is not a tool number (expected 1 to 99999999)"},
       {"2: drill", "0: drill", "tests[0].tools.0: is not a tool number (expected 1 to 99999999)"},
       {"2: drill", "999999999: drill",
        "tests[0].tools.999999999: is not a tool number (expected 1 to 99999999)"},
       {"[10, -20, 5.5]", "[10, -20]", "tests[0].program_zero_mm: a list of 2, expected 3 numbers"},
       {"kind: path, file: second.csv", "kind: move, file: second.csv",
        "tests[1].program: unknown key (its value: 'other.nc')"}},
      readCampaignWithPaths);

  // A reader of cuts names the test and what to do.
  EXPECT_THAT(errorOf([&] { readCampaign(folder.file(".")); }),
              HasSubstr("test part is of kind path, expected cut, air, tap or move; `smartmill campaign`"));
  folder.write("part.csv", "time[s],axis_x[mm],axis_z[mm]\n0,1,2\n0.01,2,2\n");
  EXPECT_THAT(errorOf([&] { readRecord(campaign, campaign.tests[0]); }),
              HasSubstr("part.csv: column axis_y is missing"));
}

constexpr const char* MOVES = R"(format: smartmill-campaign/1
model: model.yaml
tests:
- {name: rest, kind: move, file: rest.csv, sample_rate_hz: 100, stream_offset_s: {force: 0.02, tool: -0.01}}
- {name: turning, kind: move, file: turning.csv, sample_rate_hz: 100, spindle_speed_rpm: 60}
)";

TEST(Campaign, readsAndWritesMoves) {
  const TemporaryFolder folder;
  folder.write("campaign.yaml", MOVES);
  const auto expectMoves = [](const Campaign& campaign) {
    ASSERT_EQ(campaign.tests.size(), 2u);
    EXPECT_EQ(campaign.tests[0].kind, TestKind::move);
    EXPECT_EQ(campaign.tests[0].spindle_speed, 0.0);
    EXPECT_EQ(campaign.tests[0].stream_offset,
              (std::map<std::string, double>{{"force", 0.02}, {"tool", -0.01}}));
    EXPECT_DOUBLE_EQ(campaign.tests[1].spindle_speed, units::TWO_PI);
    EXPECT_TRUE(campaign.tests[1].stream_offset.empty());
  };
  const Campaign campaign = readCampaign(folder.file("."));
  expectMoves(campaign);
  writeCampaign(campaign, folder.file("copy"));
  expectMoves(readCampaign(folder.file("copy")));
  expectRefusals(
      MOVES,
      {{"force: 0.02", "sound: 0.02",
        "tests[0].stream_offset_s.sound: is not a group of columns (expected force, controller or tool)"},
       {"force: 0.02", "force: soon", "tests[0].stream_offset_s.force: 'soon' is not a number"},
       {"spindle_speed_rpm: 60", "feed_per_tooth_mm: 0.1",
        "tests[1].feed_per_tooth_mm: unknown key (its value: '0.1')"},
       {"spindle_speed_rpm: 60", "running_before_s: 1",
        "tests[1].running_before_s: unknown key (its value: '1')"}},
      readCampaign);

  folder.write("rest.csv",
               "time[s],axis_x[mm],axis_vx[mm/min],current_x[A],fx[N]\n0,1,60,2,3\n0.01,2,60,2,4\n");
  const Record record = readRecord(campaign, campaign.tests[0]);
  EXPECT_DOUBLE_EQ(record.column("axis_x")[1], 2e-3);
  EXPECT_DOUBLE_EQ(record.column("axis_vx")[0], 1e-3);
  folder.write("turning.csv", "time[s],fx[N],current_x[A]\n0,1,2\n0.01,2,3\n");
  EXPECT_THAT(errorOf([&] { readRecord(campaign, campaign.tests[1]); }),
              HasSubstr("needs a column axis_x[mm]"));
}

// A ramp in every column; the force is recorded 3.5 samples later, the tool one sample earlier.
TEST(Record, alignsGroupsWithAnOffset) {
  CampaignTest test;
  test.sample_rate = 100.0;
  test.stream_offset = {{"force", 0.035}, {"tool", -0.01}};
  Record record;
  for (int i = 0; i < 50; ++i) {
    const double t = i / 100.0;
    record.time.push_back(t);
    record.add("axis_x").push_back(t);
    record.add("fx").push_back(t - 0.035);
    record.add("tool_x").push_back(t + 0.01);
  }
  const Record moved = aligned(record, test);
  ASSERT_EQ(moved.size(), 50u - 4u - 1u);
  EXPECT_DOUBLE_EQ(moved.time.front(), 0.01);
  for (std::size_t i = 3; i + 3 < moved.size(); ++i) {
    for (const char* column : {"axis_x", "fx", "tool_x"})
      EXPECT_NEAR(moved.column(column)[i], moved.time[i], 1e-12) << column << " " << i;
  }
  test.stream_offset = {{"force", 0.5}};
  EXPECT_THAT(errorOf([&] { aligned(record, test); }), HasSubstr("longer than the record"));
  test.stream_offset.clear();
  EXPECT_EQ(aligned(record, test).size(), record.size());
}

TEST(Record, readsColumnsInAnyOrderAndNotesUnknownOnes) {
  const TemporaryFolder folder;
  const Record r = readCsv(folder.write(
      "a.csv",
      "\xEF\xBB\xBF"
      "fy[N],temperature[C],time[s],tool_x[um],fx[N]\r\n-2,hot,0,5,1\r\n -4 ,cold,0.01,1e1,+3\r\n\r\n"));
  EXPECT_EQ(r.size(), 2u);
  EXPECT_EQ(r.column("fx"), (std::vector<double>{1, 3}));
  EXPECT_EQ(r.column("fy"), (std::vector<double>{-2, -4}));
  EXPECT_DOUBLE_EQ(r.column("tool_x")[1], 10e-6);
  EXPECT_FALSE(r.has("fz"));
  ASSERT_EQ(r.notes.size(), 1u);
  EXPECT_THAT(r.notes[0], HasSubstr("column temperature[C] is not used"));
  EXPECT_THAT(errorOf([&] { r.column("fz"); }), HasSubstr("a.csv: column fz is missing"));
}

TEST(Record, writesWhatItReads) {
  const TemporaryFolder folder;
  Record r;
  for (int i = 0; i < 100; ++i) r.time.push_back(i / 25600.0);
  for (const char* name : {"fx", "tool_y", "load_meter"}) {
    std::vector<double>& column = r.add(name);
    for (int i = 0; i < 100; ++i) column.push_back(1e-6 * std::sin(0.1 * i));
  }
  writeCsv(r, folder.file("r.csv"));
  const Record back = readCsv(folder.file("r.csv"));
  EXPECT_EQ(back.names, r.names);
  for (std::size_t i = 0; i < 100; ++i) {
    EXPECT_NEAR(back.time[i], r.time[i], 1e-9 * r.time[i]);                     // nine digits
    EXPECT_NEAR(back.column("tool_y")[i], r.column("tool_y")[i], 1e-6 * 1e-6);  // six digits
  }
}

TEST(Record, writesNumbersLikePrintf) {
  const TemporaryFolder folder;
  Record r;
  std::mt19937_64 random(3);
  std::vector<double>& column = r.add("fx");
  for (int i = 0; i < 5000; ++i) {
    const double size = std::exp(std::uniform_real_distribution<double>(-12.0, 16.0)(random));
    r.time.push_back(i % 3 == 0 ? size : static_cast<double>(random() % 100000) / 1e5);
    column.push_back(i % 7 == 0 ? static_cast<double>(random() % 2000001) / 1024.0 : -size);
  }
  writeCsv(r, folder.file("r.csv"));
  std::ifstream file(folder.file("r.csv"));
  std::string line;
  std::getline(file, line);
  for (std::size_t i = 0; i < r.size(); ++i) {
    std::getline(file, line);
    ASSERT_EQ(line, formatted("%.9g,%.6g", r.time[i], r.columns[0][i]));
  }
}

TEST(Record, errorsNameLineAndColumn) {
  const TemporaryFolder folder;
  const struct {
    const char *text, *message;
  } cases[] = {
      {"time[s],fx[N]\n0,1\n0.1,nan\n0.2,3\n", "line 3: column fx: 'nan' is not a finite number"},
      {"time[s],fx[N]\n0,1\n0.1,x\n", "line 3: column fx: 'x' is not a number"},
      {"time[s],fx[N]\n0,1\n0.1,\n", "line 3: column fx: '' is not a number"},
      {"time[s],fx[N]\n0,1\n0.1\n", "line 3: 1 values, expected 2 (one per column)"},
      {"time[s],fx[N]\n0,1,2\n", "line 2: 3 values, expected 2 (one per column)"},
      {"time[s],fx[N]\n0,1\n\n0.1,2\n", "line 3: is empty"},
      {"time[s],fx[kN]\n0,1\n", "line 1: column fx: the unit is 'kN', expected N"},
      {"time[s],fx\n0,1\n", "line 1: column 'fx': expected name[unit]"},
      {"time[s],fx[N],fx[N]\n0,1,1\n", "line 1: column fx occurs twice"},
      {"fx[N]\n1\n", "column time is missing"},
      {"time[s],fx[N]\n", "no samples"},
      {"", "is empty"},
      {"time[s],fx[N]\n0,1\n0.1,1\n0.2,1\n0.4,1\n0.5,1\n",
       "line 5: column time: a step of 0.2 s, expected 0.1 s"},
      {"time[s],fx[N]\n0,1\n0.1,1\n0.05,1\n0.2,1\n0.3,1\n0.4,1\n",
       "line 4: column time: a step of -0.05 s, expected 0.1 s"},
  };
  for (const auto& c : cases) {
    const std::string file = folder.write("bad.csv", c.text);
    EXPECT_EQ(errorOf([&] { readCsv(file); }), file + ": " + c.message);
  }
  EXPECT_THAT(errorOf([&] { readCsv(folder.file("none.csv")); }), HasSubstr("none.csv: cannot be read"));
}

TEST(Record, checksTheSampleRateAndReversesAReaction) {
  const TemporaryFolder folder;
  folder.write("campaign.yaml", CAMPAIGN);
  folder.write("slot.csv", "time[s],fx[N]\n0,1\n0.01,2\n0.02,3\n");
  const Campaign campaign = readCampaign(folder.file(""));
  MachineModel model;
  EXPECT_DOUBLE_EQ(readRecord(campaign, campaign.tests[0], model).column("fx")[2], 3.0);
  model.force_sensor.measures_workpiece = true;
  EXPECT_DOUBLE_EQ(readRecord(campaign, campaign.tests[0], model).column("fx")[2], -3.0);
  folder.write("slot.csv", "time[s],fx[N]\n0,1\n0.02,2\n0.04,3\n");
  EXPECT_THAT(errorOf([&] { readRecord(campaign, campaign.tests[0]); }),
              HasSubstr("the sample rate is 50 Hz, but the campaign's sample_rate_hz is 100"));
}

TEST(Record, readsADynowareExport) {
  const TemporaryFolder folder;
  const std::string file = folder.write(
      "d.csv",
      "DynoWare,Version 2.5\nTime:, \nSampling rate [Hz]:,10\nTime,Fx,Fy,Fz\ns,N,N,N\n8,1,2,3\n8.1,4,5,6\n");
  const Record r = readDynoware(file, {{"fx", "Fy"}, {"fz", "Fz"}});
  EXPECT_EQ(r.column("fx"), (std::vector<double>{2, 5}));
  EXPECT_EQ(r.column("fz"), (std::vector<double>{3, 6}));
  EXPECT_THAT(errorOf([&] { readDynoware(file, {{"fx", "Mz"}}); }), HasSubstr("column Mz is missing"));
  EXPECT_THAT(errorOf([&] {
                readDynoware(folder.write("n.csv", "time[s]\n0\n"), {{"fx", "Fx"}});
              }),
              HasSubstr("n.csv: line 1: not a DynoWare export"));
}

// The published coefficients of the same records to every printed digit: unweighted means over all samples.
TEST(MeasuredSlots, regressionGivesThePublishedCoefficients) {
  SMARTMILL_SHARED_DATA(folder, "measured/slot_6000");
  const Campaign campaign = readCampaign(folder);
  const MachineModel model = readMachineModel(campaign.modelPath());
  std::vector<MeanForceTest> tests;
  for (const CampaignTest& test : campaign.tests) {
    const Record record = readRecord(campaign, test, model);
    EXPECT_EQ(record.size(), 10001u);
    MeanForceTest t;
    t.tool = *model.tool;
    t.engagement = *test.engagement;
    t.force = {mean(record.column("fx")), mean(record.column("fy")), mean(record.column("fz"))};
    tests.push_back(t);
  }
  const CuttingCoefficients k = identifyFromForces(tests).value;
  EXPECT_NEAR(k.ktc / 1e6, 958.8599, 5.1e-5);  // half a printed digit
  EXPECT_NEAR(k.krc / 1e6, 250.8633, 5.1e-5);
  EXPECT_NEAR(k.kac / 1e6, 146.3614, 5.1e-5);
  EXPECT_NEAR(k.kte / 1e3, 15.7580, 5.1e-5);
  EXPECT_NEAR(k.kre / 1e3, 19.4337, 5.1e-5);
  EXPECT_NEAR(k.kae / 1e3, 18.2075, 5.1e-5);
}

TEST(ExampleCampaigns, canAllBeRead) {
  SMARTMILL_SHARED_DATA(folder, "campaigns");
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (!entry.is_directory()) continue;
    const Campaign campaign = readCampaign(entry.path().string());
    readMachineModel(campaign.modelPath());
    EXPECT_GT(campaign.tests.size(), 10u) << entry.path();
    const Record record = readRecord(campaign, campaign.tests.front());
    EXPECT_TRUE(record.has("load_meter"));
  }
}

}  // namespace
}  // namespace smartmill
