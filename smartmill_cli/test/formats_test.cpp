// A cut gives the same forces and coefficients from a bag, an MCAP file, a CSV and a MATLAB file.

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <regex>

#include <gmock/gmock.h>

#include "import/mat_writer.h"
#include "shell.h"
#include "simulated_session.h"
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
    std::string plan = "format: smartmill-import/1\nmodel: " MODEL
                       "\ndefaults:\n  kind: cut\n  entry_deg: 0\n  exit_deg: 180\n  axial_depth_mm: 0.5\n  "
                       "spindle_speed_rpm: 4500\nfiles:\n";
    for (const CampaignTest& test : steady.tests) {
      // The recordings' campaign states where its record begins.
      const auto first = static_cast<std::size_t>(
          std::lround((*test.start_time - session.offset(test.name)) * SimulatedSession::RATE));
      const Record cut = part(session.record(test.name), first, readRecord(steady, test).size());
      writeCsv(cut, folder_.file(test.name + ".csv"), 9);
      writeMat(cut, folder_.file(test.name + ".mat"));
      for (const char* format : {".csv", ".mat"})
        plan += "- {file: " + test.name + format +
                ", feed_per_tooth_mm: " + std::to_string(test.engagement->feed_per_tooth / units::MM) +
                ", running_before_s: " + std::to_string(*test.running_before) + "}\n";
    }
    const std::string plan_file = folder_.write("import.yaml", plan);
    for (const std::string format : {"csv", "mat"}) {
      std::string files;
      for (const char* cut : CUTS) files += folder_.file(cut + ("." + format)) + " ";
      done("campaign " + files + "--import " + plan_file + " -o " + folder_.file(format));
    }
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

}  // namespace
}  // namespace smartmill
