// The program as a user runs it: files, exit codes, one line for each fault.

#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* MODEL =
    "format: smartmill-model/1\ntool: {teeth: 4, diameter_mm: 10.0, helix_deg: 30.0}\ncutting:\n  "
    "Ktc_n_per_mm2: 800.0\n  "
    "Krc_n_per_mm2: 300.0\n  Kac_n_per_mm2: 200.0\n  Kte_n_per_mm: 20.0\n  Kre_n_per_mm: 25.0\n  "
    "Kae_n_per_mm: 3.0\n"
    "tool_tip:\n  x: [{frequency_hz: 1210.0, damping_ratio: 0.031, stiffness_n_per_um: 28.0}]\n"
    "  y: [{frequency_hz: 1180.0, damping_ratio: 0.029, stiffness_n_per_um: 31.0}]\n";

/// A folder with the model, in which the program runs.
class Command : public ::testing::Test {
 protected:
  Command() { folder_.write("mill.yaml", MODEL); }

  /// @return exit code of a line of bash
  int shell(const std::string& line) {
    const int status = std::system(
        ("cd '" + folder_.file(".") + "' && bash -c '" + line + "' >out 2>err </dev/null").c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  int run(const std::string& text, const std::string& options = "--model mill.yaml") {
    folder_.write("part.nc", text);
    return shell(std::string(PROGRAM) + " part.nc --stock-mm 60 40 10 -o result " + options);
  }
  std::string read(const std::string& file) { return readText(folder_.file(file)); }

  TemporaryFolder folder_;
};

TEST_F(Command, WritesBlocksStepsAndPage) {
  EXPECT_EQ(run("O1\nT1 M6\nG21 G90 G0 X-10 Y10 Z5\nS6000 M3\nZ-2\nG1 X70 F1200\nG0 Z5\nX-10 Y15\nZ-2\nG1 "
                "X70\nG0 Z5\nM30\n"),
            0)
      << read("err");
  EXPECT_THAT(read("out"), AllOf(HasSubstr("largest force"), HasSubstr("line 6 (G1)"),
                                 HasSubstr("least stability margin")));
  EXPECT_THAT(read("err"), HasSubstr("x real time"));
  // The second slot overlaps the first by half: 60 x 10 x 2 and 60 x 5 x 2 mm3.
  CsvReader blocks(folder_.file("result/blocks.csv"));
  std::vector<std::string_view> cells;
  std::vector<double> volumes;
  while (blocks.nextFilled(&cells)) {
    ASSERT_EQ(cells.size(), 25u);
    if (cells[2] == "G1") volumes.push_back(blocks.number(cells[11], "volume_mm3"));
  }
  ASSERT_EQ(volumes.size(), 2u);
  EXPECT_NEAR(volumes[0], 1200.0, 1.2);
  EXPECT_NEAR(volumes[1], 600.0, 0.6);
  EXPECT_THAT(read("result/steps.csv"), HasSubstr(",0.00-90.00:2\n"));
  EXPECT_THAT(read("result/report.html"), AllOf(HasSubstr("<canvas"), HasSubstr("<td>G1")));
}

TEST_F(Command, OneLineForEachFault) {
  struct Case {
    std::string text, options, fault;
  };
  const std::string start = "G21 G90 G0 X-10 Y20 Z-2\nS3000 M3\n", model = "--model mill.yaml";
  for (const Case& c : std::vector<Case>{
           {start + "G1 X70 F600\n", model,
            "part.nc: line 3: the program ends in the middle, expected M30 or M2"},
           {start + "G2 X10 I9 F600\nM30\n", model,
            "part.nc: line 3, column 1: arc does not close: radius 9.0000 mm at its "
            "start, 11.0000 mm at its end, expected equal radii"},
           {start + "G50 R45\nM30\n", model, "part.nc: line 3, column 1: unknown word G50"},
           {start + "T2 M6 S100 M3\nG1 X70 F600\nM30\n", "--model 1=mill.yaml",
            "part.nc: line 4: T2: no model of this tool, expected --model 2=FILE"},
           {start + "G0 Z20\nG1 X70 F600\nM30\n", model,
            "part.nc: no block meets the stock (X 0 to 60, Y 0 to 40, Z -10 to 0 mm), the feed motions are "
            "in X -10 to 70, Y "
            "20 to 20, Z 20 to 20 mm"},
           {start + "G20 G1 X7 F6\nM30\n", model,
            "part.nc: line 3, column 1: G20 after lengths in mm, expected one unit in the whole program"},
           {start + "G1 X70\nM30\n", model,
            "part.nc: line 3, column 1: G1 without a feed, expected F in or before this block"},
           {start + "M5\nG1 X70 F600\nM30\n", model,
            "part.nc: line 4: G1 cuts with the spindle at rest, expected S and M3 or M4 before it"},
           {start + "M30\n", "--model mill.yaml --work-offset G60:1:2:3",
            "--work-offset G60:1:2:3: expected G54:X:Y:Z to G59:X:Y:Z, G59.1:X:Y:Z or G54.1P1:X:Y:Z [mm]"}}) {
    EXPECT_EQ(run(c.text, c.options), 1) << c.text;
    EXPECT_EQ(read("err"), "program: " + c.fault + "\n");
    EXPECT_EQ(read("out"), "");
  }
}

TEST_F(Command, ARapidMoveThatHitsTheStockIsAnErrorAfterTheFilesAreWritten) {
  EXPECT_EQ(run("G21 G90 G0 X-10 Y20 Z-2\nS3000 M3\nG1 X20 F600\nG0 X70\nM30\n"), 1);
  EXPECT_THAT(read("err"), HasSubstr("program: part.nc: line 4: G0: a rapid move hits the stock\n"));
  EXPECT_TRUE(std::filesystem::exists(folder_.file("result/blocks.csv")));
}

// A wall at Y38 in a stock of 40 mm: 60 x 2 x 2 mm3 with the radius of the tool, 60 x 3 x 2 mm3 with 4 mm.
TEST_F(Command, RadiusCompensation) {
  const std::string text = "G21 G90 G0 X-20 Y60 Z-2\nS3000 M3\nG1 G41 D1 X-10 Y38 F600\nX70\nG40 Y60\nM30\n";
  for (const auto& [options, volume] :
       std::vector<std::pair<std::string, double>>{{"", 240.0}, {" --radius-offset D1=4", 360.0}}) {
    EXPECT_EQ(run(text, "--no-stability --model mill.yaml" + options), 0) << read("err");
    CsvReader blocks(folder_.file("result/blocks.csv"));
    std::vector<std::string_view> cells;
    double removed = 0.0;
    blocks.nextFilled(&cells);
    while (blocks.nextFilled(&cells)) removed += blocks.number(cells[11], "volume_mm3");
    EXPECT_NEAR(removed, volume, 2e-3 * volume) << options;
  }
  EXPECT_EQ(run(text, "--model mill.yaml --radius-offset D1=-2"), 1);
  EXPECT_EQ(read("err"),
            "program: --radius-offset D1=-2: expected D1=RADIUS [mm] with a radius of 0 or more\n");
}

TEST_F(Command, PlanWritesProgramDifferenceAndTable) {
  folder_.write("axes.yaml",
                std::string(MODEL) +
                    "axes: {x_travel_mm: [-250, 250], y_travel_mm: [-200, 200], z_travel_mm: [-300, 0], "
                    "rapid_mm_per_min: 24000, acceleration_mm_per_s2: 5000, home_mm: [0, 0, 0]}\n");
  std::string text = "O1\nT1 M6\nG21 G90 G0 X-10 Y10 Z5\nS6000 M3\nZ-2\nG1 X70 F1200\n";
  for (int k = 0; k < 9; ++k) text += formatted("G0 Z%d\n", 6 + k);
  text += "G0 X-10 Y15\nZ-2\nG1 X70 (second)\nG1 Y16\nG0 Z5\nM30";
  EXPECT_EQ(run(text, "--model axes.yaml --plan new.nc --most-force-n 300 --most-chip-mm 0.1"), 0)
      << read("err");
  EXPECT_THAT(read("out"), AllOf(HasSubstr("plan: the feed of 3 of 3 lines"), HasSubstr("limit that binds: "),
                                 HasSubstr("with a stop after each motion")));
  EXPECT_EQ(read("part.nc"), text);
  EXPECT_NE(read("new.nc"), text);
  EXPECT_EQ(shell("diff -u --label part.nc --label new.nc part.nc new.nc > expected.diff"), 1);
  EXPECT_EQ(read("result/plan.diff"), read("expected.diff"));
  CsvReader blocks(folder_.file("result/plan.csv"));
  std::vector<std::string_view> cells;
  while (blocks.nextFilled(&cells)) EXPECT_EQ(cells.size(), 18u);
  EXPECT_EQ(blocks.line(), 4);
}

TEST_F(Command, PlansSpeedsAndStatesProbabilities) {
  const std::string text = "G21 G90 G0 X-10 Y20 Z-2\nS3000 M3\nG1 X70 F600\nG0 Z5\nM30\n";
  const std::string options =
      "--model mill.yaml --plan new.nc --most-chip-mm 0.1 --most-feed-mm-per-min 9000 ";
  EXPECT_EQ(run(text, options + "--plan-speeds-rpm 5000 20000 --chatter-probability"), 0) << read("err");
  EXPECT_THAT(read("out"), AllOf(HasSubstr("speed of line 2 (T0): 3000 rpm before, "),
                                 HasSubstr("probability of chatter")));
  EXPECT_THAT(read("new.nc"), Not(HasSubstr("S3000")));
  EXPECT_THAT(read("result/blocks.csv"),
              HasSubstr("holder_hit,chip_mm,deflection_um,chatter_probability,name\n"));
  EXPECT_EQ(run(text, options + "--plan-speeds-rpm 9000 4000"), 1);
  EXPECT_EQ(read("err"), "program: speeds of 9000 to 4000 rpm: expected 0 < low <= high\n");
  EXPECT_EQ(run(text, "--model mill.yaml --plan-speeds-rpm 4000 9000"), 2);  // without --plan
}

// Torque of the slot: N a R (Ktc c / pi + Kte / 2) = 4 x 3 mm x 5 mm x (800 x 0.2 / pi + 10) N/mm = 3.66 N m
// in the mean, 230 W at 600 rpm.
TEST_F(Command, SaysWhatShouldBeChanged) {
  folder_.write("small.yaml",
                std::string(MODEL) +
                    "spindle: {viscous_nm_s_per_rad: 1e-4, coulomb_nm: 0, load_meter_v_per_w: 1e-3, "
                    "load_meter_bandwidth_hz: 7, load_meter_resolution_v: 1e-3, max_speed_rpm: 500, "
                    "rated_torque_nm: 3.0, rated_power_w: 200}\n"
                    "axes: {x_travel_mm: [-250, 250], y_travel_mm: [-200, 200], z_travel_mm: [-300, 0], "
                    "rapid_mm_per_min: 400, acceleration_mm_per_s2: 5000, home_mm: [0, 0, 0]}\n");
  EXPECT_EQ(run("G21 G90 G0 X-10 Y20 Z-3\nS600 M3\nG1 X70 F480\nG0 X-10 Z5\nZ-3\nG1 Y21\nX70\nM30\n",
                "--model small.yaml"),
            0)
      << read("err");
  EXPECT_THAT(
      read("out"),
      AllOf(HasSubstr("to be changed: line 3 (G1): peak torque of "),
            HasSubstr(" N m; that of the spindle is 3 N m"),
            HasSubstr("to be changed: line 3 (G1): cutting power of 229.7"),
            HasSubstr(" W; that of the spindle is 200 W\n"),
            HasSubstr(
                "to be changed: line 3 (G1): spindle speed of 600 rpm; the highest is 500 rpm (and 1 more"),
            HasSubstr(
                "to be changed: line 3 (G1): feed of 480 mm/min; the rapid feed of the axes is 400 mm/min")));
  EXPECT_THAT(read("result/report.html"), HasSubstr("<h2>What should be changed</h2>"));
}

TEST_F(Command, PlanRefusesWhatItCannotDo) {
  const std::string text = "G21 G90 G0 X-10 Y20 Z-2\nS3000 M3\nG1 X70 F600\nG0 Z5\nM30\n";
  const std::string model = "--model mill.yaml ", chip = "--most-chip-mm 0.1 --most-feed-mm-per-min 9000 ";
  for (const auto& [options, fault] : std::vector<std::pair<std::string, std::string>>{
           {"--plan part.nc " + chip, "--plan part.nc: is the program itself, expected another file"},
           {"--plan ./result/../part.nc " + chip,
            "--plan ./result/../part.nc: is the program itself, expected another file"},
           {"--plan new.nc --most-chip-mm 0.1",
            "--plan: no model states axes, expected --most-feed-mm-per-min or the section axes"}}) {
    shell("mkdir -p result");
    EXPECT_EQ(run(text, model + options), 1) << options;
    EXPECT_EQ(read("err"), "program: " + fault + "\n");
  }
  EXPECT_EQ(run(text, model + "--plan new.nc --most-feed-mm-per-min 9000"), 2);
  EXPECT_THAT(read("err"), HasSubstr("expected --most-chip-mm or --most-feed-per-tooth-mm"));
  for (const std::string value : {"0", "-3", "nan"})
    EXPECT_EQ(run(text, model + "--plan new.nc " + chip + "--most-force-n " + value), 2) << value;
  EXPECT_EQ(run(text, model + chip), 2);  // limits without --plan
  EXPECT_EQ(run(text, model + "--plan new.nc " + chip + "--most-force-n 20"), 1);
  EXPECT_THAT(read("err"), HasSubstr("program: part.nc: line 3: G1: the force of the edges alone is "));
  EXPECT_FALSE(std::filesystem::exists(folder_.file("new.nc")));
  EXPECT_EQ(read("part.nc"), text);
}

// The interrupt is sent once the first line of progress is there.
TEST_F(Command, CtrlCKeepsTheBlocksUntilThen) {
  std::string text = "O1\nG21 G90 G0 X-10 Y20 Z-2\nS3000 M3\nF600\nM98 P2 L9999\nM30\nO2\n";
  for (int k = 0; k < 10; ++k) text += formatted("G1 X70 Y%d\nX-10\n", 5 + 3 * k);
  folder_.write("long.nc", text + "M99\n");
  EXPECT_EQ(
      shell(
          std::string(PROGRAM) +
          " long.nc --stock-mm 60 40 10 -o result --model mill.yaml 2>progress & pid=$!; until grep -q moves "
          "progress; do sleep 0.05; done; kill -INT $pid; wait $pid"),
      130);
  EXPECT_THAT(read("progress"), HasSubstr("interrupted in line"));
  EXPECT_TRUE(std::filesystem::exists(folder_.file("result/blocks.csv")));
}

}  // namespace
}  // namespace smartmill
