#include "smartmill_stability/coupling/tool_table.h"

#include <cstdlib>
#include <fstream>

#include <gtest/gtest.h>

#include "smartmill_core/io/uff.h"
#include "smartmill_core/modal/frf_files.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using units::TWO_PI;

/// A bar in a spindle that is one mode across and one in tilting.
Receptance spindleAt(double f) {
  const auto mode = [f](double natural, double gain) {
    return gain / std::complex<double>(1.0 - f * f / (natural * natural), 0.06 * f / natural);
  };
  Receptance s = Receptance::Zero();
  s(0, 0) = mode(700.0, 1e-8);
  s(1, 1) = mode(1500.0, 1e-6);
  return s;
}

const char* const TABLE = R"(format: smartmill-tools/1
band_hz: [100.0, 4000.0]
gauge:
  segments: [{length_mm: 90.0, diameter_mm: 40.0}]
  second_point_mm: 70.0
  x: {direct: direct.csv, cross: cross.uff, second: second.csv}
holder:
  - {length_mm: 40.0, diameter_mm: 32.0, bore_mm: 12.0, core: carbide}
  - {length_mm: 40.0, diameter_mm: 45.0}
tools:
  - {name: short, stickout_mm: 50.0, diameter_mm: 12.0, fluted_length_mm: 26.0, teeth: 4, helix_deg: 30.0, tapped: {x: tip.csv}}
  - {name: long, stickout_mm: 70.0, diameter_mm: 12.0, fluted_length_mm: 26.0, teeth: 4, helix_deg: 30.0}
)";

/// Writes the table and the FRFs that its machine would show with a contact.
void writeMachine(const TemporaryFolder& folder, const std::string& text = TABLE) {
  std::ofstream(folder.file("tools.yaml")) << text;
  const BeamMaterial steel = beamMaterial("steel");
  const BeamSegment front{0.07, 0.04, 0.0, steel, {}}, rest{0.02, 0.04, 0.0, steel, {}};
  FrequencyResponse direct, second;
  UffFunction cross;
  direct.unit = second.unit = "m/N";
  cross.type = uff::FREQUENCY_RESPONSE;
  cross.numerator = uff::ACCELERATION;
  cross.denominator = uff::EXCITATION_FORCE;
  SpindleReceptances spindle;
  for (double f = 100.0; f <= 4000.0; f += 5.0) {
    const EndReceptances a = beamReceptances(front, f);
    const Receptance back = joined(beamReceptances(rest, f), spindleAt(f), Receptance::Zero());
    const Receptance k = (a.r22 + back).inverse();
    direct.frequency.push_back(f);
    second.frequency.push_back(f);
    cross.abscissa.push_back(f);
    direct.value.push_back((a.r11 - a.r12 * k * a.r21)(0, 0));
    cross.value.push_back(-std::pow(TWO_PI * f, 2) * (a.r12 * k * back)(0, 0));
    second.value.push_back((a.r22 * k * back)(0, 0));
    spindle.frequency.push_back(f);
    spindle.value.push_back(spindleAt(f));
  }
  writeFrfCsv(direct, folder.file("direct.csv"));
  writeFrfCsv(second, folder.file("second.csv"));
  writeUff({cross}, folder.file("cross.uff"), true);
  ContactEstimate contact = ContactEstimate::prior();
  contact.log_value << std::log(6e7), std::log(2e4), std::log(300.0), std::log(0.2), 0.0;
  const BeamMaterial carbide = beamMaterial("carbide");
  const ToolAssembly machine(spindle, {{0.04, 0.032, 0.012, steel, carbide}, {0.04, 0.045, 0.0, steel, {}}});
  const ToolDescription tool{"short", 0.05, 0.012, 0.026, 4, 0.5, 0.8, carbide};
  writeFrfCsv(machine.tip(tool, contact), folder.file("tip.csv"));
}

std::string errorOf(const std::string& file) {
  try {
    readToolTable(file);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(ToolTable, DeterminesTheContactFromATappedTool) {
  const TemporaryFolder folder;
  writeMachine(folder);
  const ToolTable table = readToolTable(folder.file("tools.yaml"));
  ASSERT_EQ(table.tools.size(), 2u);
  const TableAssembly machine = assemblyOf(table, false);
  ASSERT_EQ(machine.tapped.size(), 1u);
  EXPECT_NEAR(machine.contact.value(rotation), 2e4, 0.05 * 2e4);
  // The tool that was tapped has no scatter from tool to tool.
  EXPECT_LT(machine.contactOf("short", 0.2).covariance(rotation, rotation),
            machine.contactOf("long", 0.2).covariance(rotation, rotation));
}

TEST(ToolTable, NamesFileKeyAndValueOfAFault) {
  const TemporaryFolder folder;
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = TABLE;
    text.replace(text.find(from), from.size(), to);
    std::ofstream(folder.file("tools.yaml")) << text;
    return errorOf(folder.file("tools.yaml"));
  };
  EXPECT_NE(changed("stickout_mm: 50.0", "stickout_mm: -50.0").find("stickout_mm"), std::string::npos);
  EXPECT_NE(changed("name: long", "name: short").find("expected each tool once"), std::string::npos);
  EXPECT_NE(changed("core: carbide", "core: glass").find("glass"), std::string::npos);
  EXPECT_NE(changed("second_point_mm: 70.0", "second_point_mm: 170.0").find("second point"),
            std::string::npos);
  EXPECT_NE(changed("teeth: 4", "tooth: 4").find("too"), std::string::npos);
  const ToolTable table;
  EXPECT_THROW(table.tool("none"), std::exception);
}

TEST(ToolTable, ProgramWritesAModelThatLobesReads) {
  const TemporaryFolder folder;
  writeMachine(folder);
  const auto run = [&](const std::string& rest) {
    return std::system((std::string(TOOL_FRF) + " " + folder.file("tools.yaml") + rest + " -o " +
                        folder.file("out") + " >/dev/null 2>&1")
                           .c_str());
  };
  ASSERT_EQ(run(std::string(" --tool long --uff --model ") + MODEL_FILE), 0);
  for (const char* name : {"frf_x.csv", "frf_x.png", "frf_y.uff", "modes_x.yaml"})
    EXPECT_TRUE(std::ifstream(folder.file("out") + "/" + name).good()) << name;
  const MachineModel model = readMachineModel(folder.file("out") + "/model.yaml");
  EXPECT_EQ(model.tool->teeth, 4);
  ASSERT_FALSE(model.tool_tip.x.modes.empty());
  EXPECT_GT(model.tool_tip.x.modes.front().frequency_std, 0.0);
  ASSERT_EQ(
      std::system((std::string(LOBES) + " " + folder.file("out") +
                   "/model.yaml --entry-deg 90 --exit-deg 180 --speeds 8000:9000:3 --max-depth-mm 5 -o " +
                   folder.file("chart.csv") + " >/dev/null 2>&1")
                      .c_str()),
      0);
  EXPECT_NE(run(" --tool none"), 0);
}

}  // namespace
}  // namespace smartmill::stability
