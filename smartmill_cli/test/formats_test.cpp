// A cut gives the same forces and coefficients from a bag, an MCAP file, a CSV and a MATLAB file.

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <regex>

#include <gmock/gmock.h>

#include "import/mat_writer.h"
#include "shell.h"
#include "simulated_session.h"
#include "smartmill_cli/commands.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using recording::MatWriter;
using ::testing::HasSubstr;

constexpr const char* CUTS[] = {"slow", "medium", "fast"};

/// Three slots of different feed, recorded; what they hold beyond the recordings' settling as files of
/// channels.
class Formats : public ::testing::Test {
 protected:
  Formats() {
    const std::string bag = folder_.file("session.bag");
    SimulatedSession session(bag, readMachineModel(MODEL));
    for (std::size_t i = 0; i < std::size(CUTS); ++i)
      session.slot(CUTS[i], 4500.0, (0.04 + 0.03 * static_cast<double>(i)) * units::MM, 0.5 * units::MM);
    session.close();
    done("convert " + bag + " -o " + folder_.file("session.mcap") + " --compression zstd");
    for (const std::string format : {"bag", "mcap"})
      done("campaign " + folder_.file("session." + format) + " --model " MODEL " -o " + folder_.file(format));
    const Campaign steady = readCampaign(folder_.file("bag"));
    EXPECT_EQ(steady.tests.size(), std::size(CUTS));
    const std::string stated =
        "format: smartmill-import/1\nmodel: " MODEL
        "\ndefaults:\n  kind: cut\n  entry_deg: 0\n  exit_deg: 180\n  axial_depth_mm: 0.5\n  "
        "spindle_speed_rpm: 4500\nfiles:\n";
    std::map<std::string, std::string> plans{{"csv", stated}, {"mat", stated}};
    for (const CampaignTest& test : steady.tests) {
      // The recordings' campaign states where its record begins.
      const auto first = static_cast<std::size_t>(
          std::lround((*test.start_time - session.offset(test.name)) * SimulatedSession::RATE));
      const Record cut = part(session.record(test.name), first, readRecord(steady, test).size());
      writeCsv(cut, folder_.file(test.name + ".csv"), 9);
      writeMat(cut, folder_.file(test.name + ".mat"));
      for (auto& [format, plan] : plans)
        plan += "- {file: " + test.name + "." + format +
                ", feed_per_tooth_mm: " + std::to_string(test.engagement->feed_per_tooth / units::MM) +
                ", running_before_s: " + std::to_string(*test.running_before) + "}\n";
    }
    for (const auto& [format, plan] : plans)
      done("campaign --import " + folder_.write(format + ".yaml", plan) + " -o " + folder_.file(format));
    folder_.write("import.yaml", plans.at("csv"));
  }

  static Record part(const Record& whole, std::size_t first, std::size_t count) {
    Record record;
    for (std::size_t i = 0; i < count; ++i)
      record.time.push_back(static_cast<double>(i) / SimulatedSession::RATE);
    for (const char* name : {"spindle_angle", "fx", "fy", "fz"}) {
      const auto begin = whole.column(name).begin() + static_cast<std::ptrdiff_t>(first);
      record.add(name).assign(begin, begin + static_cast<std::ptrdiff_t>(count));
    }
    return record;
  }

  static void writeMat(const Record& record, const std::string& file) {
    MatWriter mat(file, MAT_FT_MAT5, MAT_COMPRESSION_ZLIB);
    mat.add(MatWriter::numbers("Fs", {SimulatedSession::RATE}));
    mat.add(MatWriter::structOf("cut",
                                {{"spindle_angle", MatWriter::numbers("a", record.column("spindle_angle"))},
                                 {"spindle_angle_unit", MatWriter::word("u", "rad")},
                                 {"Fx_N", MatWriter::numbers("x", record.column("fx"))},
                                 {"Fy_N", MatWriter::numbers("y", record.column("fy"))},
                                 {"Fz_N", MatWriter::numbers("z", record.column("fz"))}}));
  }

  /// What a command did that must succeed.
  Outcome done(const std::string& arguments) {
    Outcome outcome = shell(SMARTMILL " " + arguments);
    EXPECT_EQ(outcome.code, 0) << arguments << "\n" << outcome.error;
    return outcome;
  }

  const TemporaryFolder folder_;
};

TEST_F(Formats, GiveTheSameForcesAndCoefficients) {
  std::map<std::string, std::string> forces;
  std::string coefficients;
  for (const std::string format : {"bag", "mcap", "csv", "mat"}) {
    const std::string campaign = folder_.file(format);
    const Outcome compensated = done("compensate " + campaign + " -o out");
    const Outcome identified = done("coefficients " + campaign + " --source force");
    EXPECT_EQ(compensated.files.size(), std::size(CUTS)) << format;
    if (format == "bag") {
      forces = compensated.files;
      coefficients = identified.out;
    } else {
      EXPECT_EQ(identified.out, coefficients) << format;
      EXPECT_TRUE(compensated.files == forces) << format;
    }
  }
  // They are those of the mill: 796 and 168 N/mm2.
  std::smatch ktc, krc;
  ASSERT_TRUE(std::regex_search(coefficients, ktc, std::regex("Ktc[^0-9-]*([-0-9.]+)"))) << coefficients;
  ASSERT_TRUE(std::regex_search(coefficients, krc, std::regex("Krc[^0-9-]*([-0-9.]+)"))) << coefficients;
  EXPECT_NEAR(std::stod(ktc[1]), 796.0, 0.01 * 796.0);
  EXPECT_NEAR(std::stod(krc[1]), 168.0, 0.02 * 168.0);
}

// The sample by sample compensation of a recording, as the node does it.
TEST_F(Formats, OfRecordingsAreCompensatedAlike) {
  const auto compensated = [&](const std::string& format) {
    Outcome outcome = done("compensate " + folder_.file("session." + format) + " --model " MODEL " -o out");
    outcome.out = std::regex_replace(outcome.out, std::regex("in [0-9.]+ s, [0-9]+ x real time"), "");
    return outcome;
  };
  const Outcome bag = compensated("bag"), mcap = compensated("mcap");
  EXPECT_EQ(bag.files.size(), std::size(CUTS));
  EXPECT_EQ(mcap.out, bag.out);
  EXPECT_TRUE(mcap.files == bag.files);
}

/// Every example of --help, typed where the files are that it names.
TEST_F(Formats, TheExamplesOfCampaignWork) {
  folder_.write("hit.csv", "time[s],hammer[N],Ch2\n0,0,0\n0.001,90,0.1\n0.002,10,-0.1\n");
  std::filesystem::copy_file(folder_.file("slow.mat"), folder_.file("cut.mat"));
  std::filesystem::copy_file(MODEL, folder_.file("mill.yaml"));
  std::size_t tried = 0;
  for (const CommandTopic& topic : smartmillProgram().topics) {
    for (const Command& command : topic.commands) {
      if (command.name != "campaign") continue;
      for (const CommandExample& example : command.examples) {
        const Outcome outcome =
            shell("cp -r '" + folder_.file(".") +
                  "' work && cd work && rm -rf campaign taps && " SMARTMILL " campaign " + example.arguments);
        EXPECT_EQ(outcome.code, 0) << example.arguments << "\n" << outcome.error;
        EXPECT_EQ(outcome.error, "") << example.arguments;
        ++tried;
      }
    }
  }
  EXPECT_EQ(tried, 4u);
}

// One line on standard error for one fault, which begins as those of all commands; nothing is written.
TEST_F(Formats, AFaultOfCampaignIsOneLine) {
  const std::string cut = folder_.file("slow.csv"), mat = folder_.file("slow.mat");
  const std::string stated =
      " --kind cut --speed-rpm 4500 --feed-per-tooth-mm 0.04 --axial-depth-mm 0.5 --entry-deg 0";
  const std::string tool = " --teeth 4 --diameter-mm 19.05 --helix-deg 30 ";
  const std::string garbage = folder_.write("garbage.csv", std::string("\x01\x00\xFF\x7F", 4));
  const std::string empty = folder_.write("empty.csv", ""), session = folder_.file("session.mcap");
  const std::vector<std::pair<std::string, std::string>> faults{
      {cut + stated + tool, cut + ": exit_deg is missing"},
      {cut + stated + " --exit-deg 180 --diameter-mm 19 --helix-deg 30", "model: tool.teeth is missing"},
      {cut + " " + cut + stated + " --exit-deg 180" + tool, cut + ": given twice"},
      {mat + stated + " --exit-deg 180 --channels 'fx=Fx[lbs]'" + tool, "unknown unit 'lbs'"},
      {mat + stated + " --exit-deg 180 --channels fx=Fq" + tool,
       "channel Fq (for fx) is missing; the file has"},
      {mat + stated + " --exit-deg 180 --sample-rate-hz 5000" + tool, "sample rate: 5000 Hz from"},
      {garbage + stated + " --exit-deg 180" + tool, garbage + ": binary data of an unknown format"},
      {empty + stated + " --exit-deg 180" + tool, empty + ": is empty"},
      {session, session + ": a recording needs the machine model"},
      {folder_.file("none.csv") + stated + " --exit-deg 180" + tool,
       "none.csv: cannot be read: No such file"}};
  for (const auto& [arguments, line] : faults) {
    const Outcome outcome = shell(SMARTMILL " campaign " + arguments + " -o out");
    EXPECT_EQ(outcome.code, 1) << arguments;
    EXPECT_EQ(linesOf(outcome.error), 1u) << outcome.error;
    EXPECT_EQ(outcome.error.rfind("smartmill campaign: ", 0), 0u) << outcome.error;
    EXPECT_THAT(outcome.error, HasSubstr(line));
    EXPECT_TRUE(outcome.files.empty()) << arguments;
  }
  EXPECT_EQ(shell(SMARTMILL " campaign -o out").code, 2);
  EXPECT_EQ(shell(SMARTMILL " campaign cut.csv --channels fx -o out").code, 2);
}

}  // namespace
}  // namespace smartmill
