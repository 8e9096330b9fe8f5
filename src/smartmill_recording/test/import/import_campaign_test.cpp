#include "smartmill_recording/import/import_campaign.h"

#include <cmath>
#include <filesystem>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hdf5_writer.h"
#include "mat_writer.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::recording {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

constexpr const char* ROWS = "0,10,1\n0.001,20,2\n0.002,30,3\n0.003,40,4\n";

ImportPlan slotPlan() {
  ImportPlan plan;
  plan.stated.kind = "cut";
  plan.stated.spindle_speed_rpm = 6000.0;
  plan.stated.feed_per_tooth_mm = 0.05;
  plan.stated.axial_depth_mm = 3.0;
  plan.stated.entry_deg = 0.0;
  plan.stated.exit_deg = 180.0;
  plan.tool.teeth = 2;
  plan.tool.diameter_mm = 25.0;
  plan.tool.helix_deg = 45.0;
  return plan;
}

class Import : public testing::Test {
 protected:
  /// Faults of one text file under a plan.
  std::vector<std::string> faultsOf(const ImportPlan& plan, const std::string& text) {
    file_ = folder_.write("cut.csv", text);
    const std::string out = folder_.file("out");
    const ImportResult result = importCampaign(plan, {file_}, out);
    EXPECT_EQ(std::filesystem::exists(out), result.faults.empty());
    std::filesystem::remove_all(out);
    std::vector<std::string> faults = result.faults;
    for (std::string& fault : faults) {
      if (fault.rfind(file_ + ": ", 0) == 0) fault.erase(0, file_.size() + 2);
    }
    return faults;
  }
  std::string leftIn(const std::string& place) const {
    std::string names;
    for (const auto& entry : std::filesystem::directory_iterator(place))
      names += entry.path().filename().string() + " ";
    return names;
  }

  TemporaryFolder folder_;
  std::string file_;
};

TEST_F(Import, oneFileNeedsNoPlan) {
  const std::string file = folder_.write("cut.csv", std::string("Time (s),Fx (kN),Fy (N)\n") + ROWS);
  const std::string out = folder_.file("out");
  const ImportResult result = importCampaign(slotPlan(), {file}, out);
  EXPECT_THAT(result.faults, IsEmpty());
  EXPECT_THAT(result.report, Contains(file + ": fx from channel Fx [kN] x 1000"));
  const Campaign campaign = readCampaign(out);
  ASSERT_EQ(campaign.tests.size(), 1u);
  const CampaignTest& test = campaign.tests[0];
  EXPECT_EQ(test.name, "cut");
  EXPECT_DOUBLE_EQ(test.sample_rate, 1000.0);
  EXPECT_NEAR(test.spindle_speed, 200.0 * units::PI, 1e-9);
  EXPECT_NEAR(test.engagement->feed_per_tooth, 5e-5, 1e-15);
  const Record record = readRecord(campaign, test);
  EXPECT_THAT(record.column("fx"), ElementsAre(10000, 20000, 30000, 40000));
  EXPECT_THAT(record.column("fy"), ElementsAre(1, 2, 3, 4));
  EXPECT_EQ(readMachineModel(campaign.modelPath()).needTool("test").teeth, 2);
}

TEST_F(Import, everyMissingThingHasItsLine) {
  EXPECT_THAT(faultsOf({}, std::string("Time,Fx,Fy\n") + ROWS),
              UnorderedElementsAre("kind is missing: cut, air or tap (expected in import.yaml or --kind)",
                                   "channel Time: no unit; expected one of s, ms, us, sec or seconds "
                                   "(channels.time.unit in import.yaml or "
                                   "--channels time=Time[UNIT])",
                                   "channel Fx: no unit; expected one of N, kN, mN, daN or lbf, or V or mV "
                                   "with a scale (channels.fx.unit "
                                   "in import.yaml or --channels fx=Fx[UNIT])",
                                   "channel Fy: no unit; expected one of N, kN, mN, daN or lbf, or V or mV "
                                   "with a scale (channels.fy.unit "
                                   "in import.yaml or --channels fy=Fy[UNIT])"));
  ImportPlan plan;
  plan.stated.kind = "cut";
  EXPECT_THAT(
      faultsOf(plan, std::string("Time (s),Fx (N),Fy (N)\n") + ROWS),
      UnorderedElementsAre(
          "spindle_speed_rpm is missing (expected in import.yaml or --speed-rpm)",
          "feed_per_tooth_mm is missing (expected in import.yaml or --feed-per-tooth-mm)",
          "axial_depth_mm is missing (expected in import.yaml or --axial-depth-mm)",
          "entry_deg is missing (expected in import.yaml or --entry-deg)",
          "exit_deg is missing (expected in import.yaml or --exit-deg)",
          "model: tool.teeth is missing (expected in import.yaml or --teeth, or a whole model with --model)",
          "model: tool.diameter_mm is missing (expected in import.yaml or --diameter-mm, or a whole model "
          "with --model)",
          "model: tool.helix_deg is missing (expected in import.yaml or --helix-deg, or a whole model with "
          "--model)"));
  plan.stated.kind = "tap";
  EXPECT_THAT(
      faultsOf(plan, std::string("Time (s),a (g),b (N)\n") + ROWS),
      UnorderedElementsAre(
          "direction is missing: x, y or z, the hammer's axis (expected in import.yaml or --direction)",
          "no hammer channel; expected a name like hammer with a unit of force, or --channels "
          "hammer=NAME[N]; the "
          "file has Time[s], a[g], b[N]",
          "no response channel; expected acceleration, displacement, tool_x, tool_y, fx, fy or fz, or "
          "--channels "
          "acceleration=NAME[m/s2]; the file has Time[s], a[g], b[N]"));
}

TEST_F(Import, nothingIsGuessed) {
  const std::string rows(ROWS);
  EXPECT_THAT(
      faultsOf(slotPlan(), "Time (s),Fx (V),Fy (N)\n" + rows),
      ElementsAre(
          "channel Fx: unit V without a sensitivity; expected N per V (channels.fx.scale in import.yaml or "
          "--channels fx=Fx[V]*SCALE)"));
  EXPECT_THAT(
      faultsOf(slotPlan(), "Time (s),Fx (mm),Fy (N)\n" + rows),
      ElementsAre(
          "channel Fx: unit mm is not a force; expected one of N, kN, mN, daN or lbf, or V or mV with a "
          "scale for fx"));
  EXPECT_THAT(faultsOf(slotPlan(), "Time (s),Fx (furlong),Fy (N)\n" + rows),
              ElementsAre(HasSubstr("channel Fx: unknown unit 'furlong'")));
  EXPECT_THAT(
      faultsOf(slotPlan(), "Time (s),Fx (N),x_force (N)\n" + rows),
      ElementsAre(
          "fx may be any of Fx, x_force; state one (channels.fx.name in import.yaml or --channels fx=NAME)"));
  EXPECT_THAT(
      faultsOf(slotPlan(), "Time (s),Ch1 (N),Ch2 (N)\n" + rows),
      ElementsAre(
          "no force channel; expected fx, fy or fz with a unit of force, or --channels fx=NAME[N]; the file "
          "has Time[s], Ch1[N], Ch2[N]"));
  EXPECT_THAT(
      faultsOf(slotPlan(), "Fx (N),Fy (N),Fz (N)\n" + rows),
      ElementsAre(
          "sample_rate_hz is missing: no channel of time and no rate in the file (expected in import.yaml "
          "or --sample-rate-hz)"));
  ImportPlan plan = slotPlan();
  plan.stated.channels = channelChoices("fx=Ch1[N],fy=Ch1[N]");
  EXPECT_THAT(faultsOf(plan, "Time (s),Ch1 (N),Ch2 (N)\n" + rows),
              ElementsAre("channel Ch1 is stated for fx and for fy"));
  plan.stated.channels = channelChoices("fx=Ch7[N]");
  EXPECT_THAT(faultsOf(plan, "Time (s),Ch1 (N),Ch2 (N)\n" + rows),
              ElementsAre("channel Ch7 (for fx) is missing; the file has Time[s], Ch1[N], Ch2[N]"));
  plan = slotPlan();
  plan.stated.sample_rate_hz = 500.0;
  EXPECT_THAT(
      faultsOf(plan, "Time (s),Fx (N),Fy (N)\n" + rows),
      ElementsAre("sample rate: 1000 Hz from the times, 500 Hz from --sample-rate-hz or import.yaml"));
  plan = slotPlan();
  plan.stated.exit_deg = 0.0;
  EXPECT_THAT(faultsOf(plan, "Time (s),Fx (N),Fy (N)\n" + rows),
              ElementsAre("exit_deg: 0 is out of range (> entry_deg 0)"));
}

TEST_F(Import, badColumnsHaveTheirLines) {
  EXPECT_THAT(
      faultsOf(slotPlan(), "Time (s),Fx (N),Fy (N)\n0,1,1\n0.001,1,1\n0.005,1,1\n0.006,1,1\n0.007,1,1\n"),
      ElementsAre("channel Time: uneven time: a step of 0.004 s after sample 2, 0.001 s expected"));
  EXPECT_THAT(faultsOf(slotPlan(), "Time (s),Fx (N)\n0,1\n0.1,1\n0.1,1\n0.2,1\n"),
              ElementsAre("channel Time: times must increase: 0.1 s at sample 2, 0.1 s at the next"));
  std::string two_rates = "Time (s),Fx (N)\n";
  for (int i = 0; i < 40; ++i) two_rates += formatted("%.6g,1\n", i < 30 ? 1e-4 * i : 3e-3 + 2e-4 * (i - 30));
  EXPECT_THAT(
      faultsOf(slotPlan(), two_rates),
      ElementsAre("channel Time: uneven time: a step of 0.0002 s after sample 31, 0.0001 s expected"));
  const std::string file = folder_.file("cut.mat"), out = folder_.file("out");
  {
    MatWriter mat(file, MAT_FT_MAT5);
    mat.add(MatWriter::numbers("t_s", {0, 1, 2, 3}));
    mat.add(MatWriter::numbers("fx_N", {0, 1, 2}));
    mat.add(MatWriter::numbers("fy_N", {0, 1, std::numeric_limits<double>::quiet_NaN(), 3}));
    mat.add(MatWriter::numbers("fz_N", {4}));
  }
  EXPECT_THAT(importCampaign(slotPlan(), {file}, out).faults,
              UnorderedElementsAre(file + ": channel fx: 3 values, 4 expected as of channel t",
                                   file + ": channel fy: value 3 is not a finite number"));
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST_F(Import, sensitivityAndScale) {
  const std::string rows = "Time (s),Hammer (mV),Acc (V)\n" + std::string(ROWS);
  const std::string file = folder_.write("hit.csv", rows);
  const std::string plan_file = folder_.write("import.yaml",
                                              "format: smartmill-import/1\n"
                                              "defaults:\n"
                                              "  kind: tap\n"
                                              "  direction: x\n"
                                              "  channels:\n"
                                              "    hammer: {sensitivity_mv_per_n: 2.0}\n"
                                              "    acceleration: {unit: V, sensitivity_mv_per_g: 100.0}\n"
                                              "files:\n"
                                              "- {file: hit.csv, name: first, start_time_s: 5.0}\n");
  const ImportPlan plan = readImport(plan_file);
  ASSERT_EQ(plan.files.size(), 1u);
  const ImportResult result = importCampaign(plan, {plan.files[0].file}, folder_.file("out"));
  EXPECT_THAT(result.faults, IsEmpty());
  const Campaign campaign = readCampaign(folder_.file("out"));
  EXPECT_EQ(campaign.tests[0].name, "first");
  EXPECT_EQ(campaign.tests[0].start_time, 5.0);
  const Record record = readRecord(campaign, campaign.tests[0]);
  EXPECT_NEAR(record.column("hammer")[3], 20.0, 1e-9);           // 40 mV at 2 mV/N
  EXPECT_NEAR(record.column("acceleration")[3], 392.266, 1e-6);  // 4 V at 100 mV/g: 40 g
}

TEST_F(Import, planIsStrict) {
  const auto fault = [&](const std::string& text) {
    const std::string file = folder_.write("import.yaml", "format: smartmill-import/1\n" + text);
    const std::string line = errorOf([&] { readImport(file); });
    return line.substr(std::min(line.size(), file.size() + 2));
  };
  EXPECT_EQ(fault("default: {}\n"), "default: unknown key (its value: a map)");
  EXPECT_THAT(fault("defaults: {kind: slot}\n"),
              HasSubstr("defaults.kind: 'slot' is not one of cut | air | tap"));
  EXPECT_THAT(fault("defaults: {spindle_speed_rpm: 0}\n"),
              HasSubstr("defaults.spindle_speed_rpm: 0 is out of range"));
  EXPECT_THAT(fault("defaults: {channels: {f: {name: a}}}\n"),
              HasSubstr("'f' is not a column; expected one of time"));
  EXPECT_THAT(fault("defaults: {channels: {fx: {scale: 2.0, sensitivity_mv_per_n: 2.0}}}\n"),
              HasSubstr("contradicts scale"));
  EXPECT_THAT(fault("tool: {teeth: 2.5}\n"), HasSubstr("tool.teeth: 2.5 is not an integer"));
  EXPECT_THAT(fault("files:\n- {file: a.csv}\n- {file: ./a.csv}\n"), HasSubstr("is listed twice"));
}

TEST_F(Import, channelsOfTheCommandLine) {
  const ChannelChoices choices = channelChoices("fx=s.Fx[V]*-200,time=[ms],fy=2");
  EXPECT_EQ(choices.at("fx").name, "s.Fx");
  EXPECT_EQ(choices.at("fx").unit, "V");
  EXPECT_EQ(choices.at("fx").scale, -200.0);
  EXPECT_FALSE(choices.at("time").name);
  EXPECT_EQ(choices.at("fy").name, "2");
  EXPECT_THAT(errorOf([] { channelChoices("fx"); }), HasSubstr("'fx': COLUMN=NAME[UNIT]*SCALE expected"));
  EXPECT_THAT(errorOf([] { channelChoices("fx=a*b"); }), HasSubstr("'b' is not a number"));
  EXPECT_THAT(errorOf([] { channelChoices("fx=a*0"); }), HasSubstr("the scale of fx"));
  EXPECT_THAT(errorOf([] { channelChoices("fx=a,fx=b"); }), HasSubstr("fx is stated twice"));
}

TEST_F(Import, nothingIsLeftAfterAFault) {
  const std::string good = folder_.write("good.csv", std::string("Time (s),Fx (N),Fy (N)\n") + ROWS);
  const std::string bad = folder_.write("bad.csv", "words\n"), place = folder_.file("place");
  std::filesystem::create_directory(place);
  EXPECT_EQ(importCampaign(slotPlan(), {good, bad}, place + "/out").faults.size(), 1u);
  EXPECT_EQ(leftIn(place), "");
  EXPECT_THAT(importCampaign(slotPlan(), {good, place + "/../good.csv"}, place + "/out").faults,
              ElementsAre(place + "/../good.csv: given twice"));
  std::filesystem::create_directory(folder_.file("other"));
  const std::string other = folder_.file("other") + "/good.csv";
  std::filesystem::copy_file(good, other);
  EXPECT_THAT(
      importCampaign(slotPlan(), {good, other}, place + "/out").faults,
      ElementsAre(other + ": a second test named good; expected different names (name in import.yaml)"));
  EXPECT_EQ(leftIn(place), "");
  EXPECT_THAT(importCampaign(slotPlan(), {good}, place + "/out").faults, IsEmpty());
  EXPECT_EQ(leftIn(place), "out ");
  EXPECT_EQ(errorOf([&] { importCampaign(slotPlan(), {good}, place + "/out"); }),
            place + "/out: exists and is not an empty folder");
}

/// The same record as CSV, MATLAB 5, 7 and 7.3, and HDF5: the same forces.
TEST_F(Import, sameForcesFromEveryFile) {
  SMARTMILL_SHARED_DATA(shared, "campaigns/none");
  const Campaign campaign = readCampaign(shared);
  const CampaignTest* cut = nullptr;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind == TestKind::cut && !cut) cut = &test;
  }
  ASSERT_TRUE(cut);
  const Record record = readRecord(campaign, *cut);
  std::vector<double> kilo = record.column("fx");
  for (double& v : kilo) v *= 1e-3;
  std::vector<std::string> files{campaign.pathOf(*cut)};
  int number = 0;
  for (const auto& [version, packing] :
       {std::pair{MAT_FT_MAT5, MAT_COMPRESSION_NONE}, std::pair{MAT_FT_MAT5, MAT_COMPRESSION_ZLIB},
        std::pair{MAT_FT_MAT73, MAT_COMPRESSION_NONE}}) {
    files.push_back(folder_.file("mat_" + std::to_string(++number) + ".mat"));
    MatWriter mat(files.back(), version, packing);
    mat.add(MatWriter::structOf("cut", {{"time_s", MatWriter::numbers("time_s", record.time)},
                                        {"fx_kN", MatWriter::numbers("fx_kN", kilo)},
                                        {"fy_N", MatWriter::numbers("fy_N", record.column("fy"))},
                                        {"fz_N", MatWriter::numbers("fz_N", record.column("fz"))}}));
  }
  files.push_back(folder_.file("cut.h5"));
  {
    Hdf5Writer hdf5(files.back());
    hdf5.dataset("fx", kilo, {kilo.size()}, "kN");
    hdf5.dataset("fy", record.column("fy"), {kilo.size()}, "N");
    hdf5.dataset("fz", record.column("fz"), {1, kilo.size()}, "N");
    hdf5.number("/", "sample_rate_hz", cut->sample_rate);
  }
  const ImportResult result = importCampaign(slotPlan(), files, folder_.file("out"));
  EXPECT_THAT(result.faults, IsEmpty());
  const Campaign made = readCampaign(folder_.file("out"));
  ASSERT_EQ(made.tests.size(), files.size());
  for (const CampaignTest& test : made.tests) {
    const Record read = readRecord(made, test);
    EXPECT_DOUBLE_EQ(test.sample_rate, cut->sample_rate);
    for (const char* name : {"fx", "fy", "fz"}) {
      const std::vector<double>&expected = record.column(name), &found = read.column(name);
      ASSERT_EQ(found.size(), expected.size());
      double worst = 0.0;
      for (std::size_t i = 0; i < found.size(); ++i)
        worst = std::max(worst, std::abs(found[i] - expected[i]) / std::max(1e-3, std::abs(expected[i])));
      EXPECT_LT(worst, 1e-8) << test.name << " " << name;  // nine digits are printed
    }
  }
}

}  // namespace
}  // namespace smartmill::recording
