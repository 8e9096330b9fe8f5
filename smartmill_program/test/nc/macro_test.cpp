// Macro B: the moves of programs with variables against those computed here.

#include <cmath>

#include <gmock/gmock.h>

#include "smartmill_core/formatted.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_program/nc/program_reader.h"

namespace smartmill::program {
namespace {

using units::MM;
using units::PI;

std::vector<Move> movesOf(const std::string& text) {
  return interpretProgram(text, "part.nc");
}

/// [mm] x and y of the ends of the feed motions.
std::vector<std::array<double, 2>> endsOf(const std::string& text) {
  std::vector<std::array<double, 2>> ends;
  for (const Move& move : movesOf(text))
    if (!move.rapid && move.path.length() > 0.0)
      ends.push_back({move.path.target()[0] / MM, move.path.target()[1] / MM});
  return ends;
}

std::vector<double> xOf(const std::string& text) {
  std::vector<double> values;
  for (const auto& end : endsOf(text)) values.push_back(end[0]);
  return values;
}

const std::string START = "G21 G90 G17 G0 X0 Y0\nZ0 S3000 M3 F100\n";

// A circle of holes by G65: radius A, number B, first angle I.
TEST(Macro, CircleOfHoles) {
  const std::string text =
      "G21 G90 G0 X0 Y0 Z10\nS1000 M3\nG65 P9100 A30. B6 I15 (six holes)\nM30\nO9100\n#10=0\nWHILE[#10 LT "
      "#2]DO1\n"
      "#11=#4+360*#10/#2\nG99 G81 X[#1*COS[#11]] Y[#1*SIN[#11]] Z-5 R2 F100\n#10=#10+1\nEND1\nG80\nM99\n";
  const auto holes = endsOf(text);
  ASSERT_EQ(holes.size(), 6u);
  for (std::size_t k = 0; k < 6; ++k) {
    const double angle = PI / 12 + static_cast<double>(k) * PI / 3;
    EXPECT_NEAR(holes[k][0], 30 * std::cos(angle), 1e-9);
    EXPECT_NEAR(holes[k][1], 30 * std::sin(angle), 1e-9);
  }
}

TEST(Macro, JumpsAndLoops) {
  using ::testing::ElementsAre;
  EXPECT_THAT(xOf(START + "#1=1\nN5 G1 X#1\n#1=#1*2\nIF [#1 LE 8] GOTO 5\nGOTO9\nX99\nN9 X[-#1]\nM30\n"),
              ElementsAre(1, 2, 4, 8, -16));
  // A backward search begins at the end of the program; nested loops; a loop that is not entered.
  EXPECT_THAT(xOf(START + "GOTO 2\nN1 G1 X7\nM30\nN2 G1 X6\nGOTO 1\nM30\n"), ElementsAre(6, 7));
  EXPECT_THAT(
      xOf(START + "G1\n#1=1\nWHILE[#1LE2]DO1\n#2=1\nWHILE[#2LE2]DO2\nX[10*#1+#2]\n#2=#2+1\nEND2\n#1=#1+1\n"
                  "END1\nWHILE[1EQ0]DO1\nX99\nEND1\nX5\nM30\n"),
      ElementsAre(11, 12, 21, 22, 5));
  EXPECT_THAT(xOf(START + "IF[#1EQ#0]THEN#2=3\nIF[#1NE#0]THEN#2=5/0\nG1 X#2 Y#1\nM30\n"), ElementsAre(3));
  // Sequence numbers are those of the program in execution.
  EXPECT_THAT(xOf(START + "M98 P2\nN1 G1 X1\nM30\nO2\nGOTO 1\nG1 X98\nN1 G1 X2\nM99\n"), ElementsAre(2, 1));
}

// #1 to #33 are local to a call by G65, those of M98 are the caller's; #100 is common.
TEST(Macro, LocalAndCommonVariables) {
  EXPECT_THAT(
      xOf(START +
          "#1=5\n#100=2\nG1\nG65 P7 A3 X4 L2\nX[#1+#100]\nM98 P8\nX#1\nM30\nO7\n#1=#1*#100\nX#1\nX[#24+#1]\n"
          "#100=#100+1\nM99\nO8\n#1=50\nM99\n"),
      ::testing::ElementsAre(6, 10, 9, 13, 9, 50));
}

TEST(Macro, NamesTheLineOfAFault) {
  const auto faultOf = [](const std::string& text) { return errorOf([&] { movesOf(START + text); }); };
  struct Case {
    std::string text, fault;
  };
  for (const Case& c : std::vector<Case>{
           {"GOTO 7\nM30\n", "line 3, column 1: GOTO7: N7 is not in the program"},
           {"WHILE[1EQ0]DO2\nM30\n", "line 3, column 1: DO2: END2 is not in the program"},
           {"END1\nM30\n", "line 3, column 1: END1: DO1 is not in the program"},
           {"N1 GOTO 1\nM30\n", "line 3, column 4: more than 1000000 jumps, expected a loop that ends"},
           {"IF[1EQ1]X5\nM30\n", "line 3, column 9: IF without GOTO or THEN"},
           {"WHILE[1EQ1]\nM30\n", "line 3, column 12: WHILE without DO, expected DO1 to DO3"},
           {"#1=5 X3\nM30\n", "line 3, column 6: expected the end of the block"},
           {"#5041=1\nM30\n",
            "line 3, #5041 is not supported, expected #1 to #33, #100 to #199 or #500 to #999"},
           {"#1=1/0\nM30\n", "line 3, column 6: division by zero"},
           {"G65 A1\nM30\n", "line 3, column 1: G65 without P, expected the number of a subprogram"},
           {"G65 P5 A1\nM30\n", "line 3, column 1: P5: subprogram O5 is not in the file"},
           {"G65 P5 N1\nM30\n", "line 3, column 8: G65 with N, expected P, L or an argument"},
           {"G1 X[1+\nM30\n", "line 3, column 8: malformed expression"}})
    EXPECT_EQ(faultOf(c.text), "part.nc: " + c.fault) << c.text;
}

}  // namespace
}  // namespace smartmill::program
