// LinuxCNC's own interpreter against the reader of this package, and what only it understands.

#include "smartmill_program/nc/linuxcnc_program.h"

#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include <gtest/gtest.h>

#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::MM;
using units::PI;

/// Skipped where LinuxCNC is not installed.
class LinuxcncProgram : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v rs274 >/dev/null") != 0) GTEST_SKIP() << "LinuxCNC is not installed";
  }
};

TEST_F(LinuxcncProgram, HasTheMovesOfTheReader) {
  const std::string text =
      "%\nO0001 (PART)\nG21 G90 G54 G17 G40 G49 G80 G94\nT2 M6\nS6000 M3\nG0 X10. Y20. Z5.\nG1 Z-2. F300 "
      "(plunge)\n"
      "X50. F600\nG2 X60 Y10 I0 J-10\nG3 X50 Y0 R10\nG3 I5 Z-3\nG91 G1 Y-10. M8\nG90 G18 G2 X60 Z-3 I5 "
      "K0\nG17\n"
      "G95 G1 X70 F0.1\nG4 P0.5\nG94 F200\nG98 G81 X80 Y5 Z-4 R1\nX90\nG80\nG28 G91 Z0\nG90 G0 X0 Y0\nZ3\nG1 "
      "Z1\nM5\nM30\n%\n";
  std::string own = text;
  own.replace(own.find("O0001 "), 6, "");  // a program number is an error of LinuxCNC
  const std::vector<Move> expected = interpretProgram(own, "part.nc"),
                          moves = interpretWithLinuxcnc(own, "part.nc");
  ASSERT_EQ(moves.size(), expected.size());
  for (std::size_t k = 0; k < moves.size(); ++k) {
    EXPECT_EQ(moves[k].line, expected[k].line) << k;
    EXPECT_EQ(moves[k].rapid, expected[k].rapid) << k;
    EXPECT_EQ(moves[k].tool, expected[k].tool) << k;
    EXPECT_NEAR(moves[k].feed, expected[k].feed, 1e-6) << k;
    EXPECT_NEAR(moves[k].dwell, expected[k].dwell, 1e-9) << k;
    EXPECT_NEAR(moves[k].spindle_speed, expected[k].spindle_speed, 1e-6) << k;
    for (const double share : {0.0, 0.3, 1.0})
      for (std::size_t a = 0; a < 3; ++a)
        EXPECT_NEAR(moves[k].path.at(share * moves[k].path.length())[a],
                    expected[k].path.at(share * expected[k].path.length())[a], 0.5e-6)
            << k << " line " << moves[k].line;
  }
}

// A running LinuxCNC has its tool table in ~/.tool.mmap.
TEST_F(LinuxcncProgram, SparesTheToolTableOfARunningLinuxcnc) {
  const TemporaryFolder home;
  home.write(".tool.mmap", "tools of the machine");
  const std::string before = std::getenv("HOME") ? std::getenv("HOME") : "";
  ASSERT_EQ(setenv("HOME", home.file("").c_str(), 1), 0);
  const std::vector<Move> moves = interpretWithLinuxcnc("T2 M6\nG0 X0 Y0 Z5\nG1 X1 F100\nM2\n", "part.ngc");
  ASSERT_EQ(setenv("HOME", before.c_str(), 1), 0);
  ASSERT_EQ(moves.back().tool, 2);
  EXPECT_EQ(readText(home.file(".tool.mmap")), "tools of the machine");
}

TEST_F(LinuxcncProgram, ExecutesOWords) {
  const std::vector<Move> moves = interpretWithLinuxcnc(
      "o<tooth> sub\nG1 X#1 F100\nG1 Y[#1 + #<_step>]\no<tooth> endsub\nG21 G90 G17\nS1000 M3\n#<_step> = 2\n"
      "G0 X0 Y0 Z1\no10 repeat [3]\no<tooth> call [5]\nG1 X0 Y0\no10 endrepeat\nM2\n",
      "part.ngc");
  ASSERT_EQ(moves.size(), 9u);
  EXPECT_EQ(moves[1].line, 3);
  EXPECT_NEAR(moves[1].path.target()[1], 7 * MM, 1e-9);
  EXPECT_EQ(moves[2].line, 11);
}

TEST_F(LinuxcncProgram, CompensatesTheRadiusOfTheTool) {
  ReaderOptions options;
  options.tool_radius = [](int tool) {
    if (tool != 3) throw std::runtime_error("a tool that the program does not use");
    return 4 * MM;
  };
  const std::vector<Move> moves = interpretWithLinuxcnc(
      "G21 G90 G17\nT3 M6 (or T4)\n#1 = 0\no1 while [#1 lt 2]\n#1 = [#1 + 1]\no1 endwhile\nS1000 M3\nG0 X0 "
      "Y0 Z0\nG41 G1 X20 Y10 F100\nX40\nG40 G1 X50 Y0\nM2\n",
      "a.ngc", options);
  double highest = 0.0;
  for (const Move& move : moves) highest = std::max(highest, move.path.target()[1]);
  EXPECT_NEAR(highest, 14 * MM, 1e-6);
}

TEST_F(LinuxcncProgram, ErrorsNameTheLine) {
  const auto fault = [](const std::string& text) {
    return errorOf([&] { interpretWithLinuxcnc(text, "part.ngc"); });
  };
  EXPECT_EQ(fault("G21 G90\nG1 XX F100\nM2\n"),
            "part.ngc: line 2: Unknown word where unary operation could be");
  EXPECT_EQ(fault("G21 G90\nG0 X0 Y0 Z0\nG1 X5 A10 F100\nM2\n"),
            "part.ngc: line 3: rotary axes, expected X, Y and Z only");
  EXPECT_EQ(fault("G21 G90\nG1 X5 F100\nM2\n"),
            "part.ngc: line 2: G1 from an unknown position, expected G0 to X, Y and Z first");
}

}  // namespace
}  // namespace smartmill::program
