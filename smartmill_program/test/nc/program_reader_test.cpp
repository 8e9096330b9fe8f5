// Moves of NC programs, and the message for each fault.

#include "smartmill_program/nc/program_reader.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>

#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using ::testing::HasSubstr;
using units::MM;
using units::PI;

std::vector<Move> movesOf(const std::string& text, const ReaderOptions& options = {}) {
  return interpretProgram(text, "part.nc", options);
}

std::string faultOf(const std::string& text, const ReaderOptions& options = {}) {
  return errorOf([&] { movesOf(text, options); });
}

void expectPoint(const nc::PathSegment::Point& point, double x, double y, double z) {
  EXPECT_NEAR(point[0], x * MM, 1e-9);
  EXPECT_NEAR(point[1], y * MM, 1e-9);
  EXPECT_NEAR(point[2], z * MM, 1e-9);
}

const std::string START = "G00 G21 G90 G17 G80 X0 Y0\nZ0 S3000 M3\n";

TEST(ProgramReader, LinesWithModalState) {
  const auto moves = movesOf(
      "%\nO0001 (PART)\nG21 G90 G54 G17 G40 G49 G80 G94\nT2 M6\nS6000 M3\nG0 G43 X10. Y20. Z5. H2\nG1 Z-2. "
      "F300 "
      "(plunge)\nX50. F600 ; comment of LinuxCNC\nG91 Y-10. M8\nM5\nM30\n%\nrest of the tape\n");
  ASSERT_EQ(moves.size(), 3u);
  EXPECT_EQ(moves[0].line, 7);
  EXPECT_EQ(moves[0].operation, "G1");
  EXPECT_EQ(moves[0].tool, 2);
  EXPECT_FALSE(moves[0].rapid);
  EXPECT_NEAR(moves[0].feed, 0.3 / 60.0, 1e-12);
  EXPECT_NEAR(moves[0].spindle_speed, 2 * PI * 100.0, 1e-9);
  expectPoint(moves[0].path.target(), 10, 20, -2);
  EXPECT_NEAR(moves[1].feed, 0.6 / 60.0, 1e-12);
  expectPoint(moves[2].path.start(), 50, 20, -2);
  expectPoint(moves[2].path.target(), 50, 10, -2);
}

// A comment in a line of its own, with or without N; one behind words names nothing.
TEST(ProgramReader, CommentsAreNames) {
  const std::vector<Move> moves = movesOf(
      "G21 G90 G0 X0 Y0 Z5\nS3000 M3 F600\nG1 X1\n( rough, level 1 )\nG1 X2 (fast)\nX3\nN10 "
      "(finish)\n()\nX4\n; last\n"
      "X5\nM30\n");
  const auto nameAt = [&](double x) -> std::string {
    for (const Move& move : moves)
      if (std::abs(move.path.target()[0] - x * MM) < 1e-9 && !move.rapid)
        return move.name ? *move.name : "none";
    return "no move";
  };
  EXPECT_EQ(nameAt(1), "none");
  EXPECT_EQ(nameAt(2), "rough, level 1");
  EXPECT_EQ(nameAt(3), "rough, level 1");
  EXPECT_EQ(nameAt(4), "finish");
  EXPECT_EQ(nameAt(5), "last");
}

// Half circle about (10, 0): by I and J, and by R; seen from +z clockwise it passes y > 0 when it starts at x
// = 0.
TEST(ProgramReader, ArcsByCentreAndByRadius) {
  for (const std::string arc : {"G2 X20 Y0 I10 J0 F100", "G2 X20 Y0 R10 F100", "G2 X20 I10 F100"}) {
    const auto moves = movesOf(START + arc + "\nM30\n");
    ASSERT_EQ(moves.size(), 1u) << arc;
    EXPECT_NEAR(moves[0].path.length(), PI * 10 * MM, 1e-9) << arc;
    expectPoint(moves[0].path.at(0.5 * moves[0].path.length()), 10, 10, 0);
  }
  // Negative R: more than half a circle. Chord 10 in a circle of radius 10: 60 or 300 degrees.
  EXPECT_NEAR(movesOf(START + "G3 X10 R10 F100\nM30\n")[0].path.length(), PI / 3 * 10 * MM, 1e-9);
  EXPECT_NEAR(movesOf(START + "G3 X10 R-10 F100\nM30\n")[0].path.length(), 5 * PI / 3 * 10 * MM, 1e-9);
  // Full circle and helix of one turn with 3 mm pitch.
  EXPECT_NEAR(movesOf(START + "G3 I5 F100\nM30\n")[0].path.length(), 2 * PI * 5 * MM, 1e-9);
  const auto helix = movesOf(START + "G3 X0 Y0 Z-3 I5 F100\nM30\n");
  EXPECT_NEAR(helix[0].path.length(), std::hypot(2 * PI * 5, 3.0) * MM, 1e-9);
  expectPoint(helix[0].path.at(0.5 * helix[0].path.length()), 10, 0, -1.5);
}

// Clockwise is seen against the third axis: in G18 from +y with z to the right and x up, in G19 from +x with
// y to the right.
TEST(ProgramReader, ArcsInOtherPlanes) {
  const auto zx = movesOf(START + "G18 G2 X10 Z-10 I0 K-10 F100\nM30\n");
  ASSERT_EQ(zx.size(), 1u);
  EXPECT_NEAR(zx[0].path.length(), 1.5 * PI * 10 * MM, 1e-9);
  const auto back = movesOf(START + "G18 G3 X10 Z-10 I0 K-10 F100\nM30\n");
  EXPECT_NEAR(back[0].path.length(), 0.5 * PI * 10 * MM, 1e-9);
  expectPoint(back[0].path.at(0.5 * back[0].path.length()), 10 * std::sin(PI / 4), 0,
              -10 + 10 * std::cos(PI / 4));
  const auto yz = movesOf(START + "G19 G2 Y10 Z-10 J0 K-10 F100\nM30\n");
  EXPECT_NEAR(yz[0].path.length(), 0.5 * PI * 10 * MM, 1e-9);
}

TEST(ProgramReader, InchesFeedPerRevolutionAndWorkOffsets) {
  const auto inch = movesOf("G20 G90 G0 X0 Y0 Z1\nS1000 M4\nG95 G1 X2 F0.01\nM2\n");
  expectPoint(inch[0].path.target(), 50.8, 0, 25.4);
  EXPECT_NEAR(inch[0].feed, 0.254e-3 * 1000.0 / 60.0, 1e-12);
  EXPECT_TRUE(inch[0].left_hand);
  ReaderOptions options;
  options.work_offsets["G55"] = {10 * MM, 20 * MM, -5 * MM};
  const auto moved = movesOf("G54 G0 X0 Y0 Z0\nG55 G0 X1 Y1 Z1\nM30\n", options);
  expectPoint(moved[0].path.target(), 11, 21, -4);
}

TEST(ProgramReader, ExtendedAndLocalOffsets) {
  ReaderOptions options;
  options.work_offsets["G54.1P3"] = {10 * MM, 20 * MM, -5 * MM};
  options.work_offsets["G59.2"] = {1 * MM, 2 * MM, 3 * MM};
  const auto moves = movesOf(
      "G54 G0 X0 Y0 Z0\nG54.1 P3 X1 Y1 Z1\nG52 X2 Z-1\nX1 Y1 Z1\nG59.2 X0 Y0 Z0\nG52 X0 Y0 Z0\nX0 Y0 "
      "Z0\nM30\n",
      options);
  ASSERT_EQ(moves.size(), 4u);
  expectPoint(moves[0].path.target(), 11, 21, -4);
  expectPoint(moves[1].path.target(), 13, 21, -5);
  expectPoint(moves[2].path.target(), 3, 2, 2);
  expectPoint(moves[3].path.target(), 1, 2, 3);
  EXPECT_EQ(faultOf("G54 G0 X0 Y0 Z0\nG54.1 P2 X1\nM30\n"),
            "part.nc: line 2, column 1: G54.1P2 after G54: its offset is unknown, expected --work-offset "
            "G54.1P2:X:Y:Z");
}

// A square and an arc about (10, 0), turned by 90 degrees about (5, 5): (x, y) becomes (10 - y, x).
TEST(ProgramReader, RotatedCoordinates) {
  const auto moves = movesOf(
      START + "G68 X5 Y5 R90\nG1 X10 Y0 F100\nG91 X0 Y3\nG90 G2 X10 Y-3 I0 J-3\nG69\nG1 X0 Y0\nM30\n");
  ASSERT_EQ(moves.size(), 4u);
  expectPoint(moves[0].path.start(), 0, 0, 0);
  expectPoint(moves[0].path.target(), 10, 10, 0);
  expectPoint(moves[1].path.target(), 7, 10, 0);
  EXPECT_NEAR(moves[2].path.sweep(), -PI, 1e-9);
  EXPECT_NEAR(moves[2].path.centre()[0], 10 * MM, 1e-9);
  EXPECT_NEAR(moves[2].path.centre()[1], 10 * MM, 1e-9);
  expectPoint(moves[2].path.target(), 13, 10, 0);
  expectPoint(moves[3].path.start(), 13, 10, 0);
  expectPoint(moves[3].path.target(), 0, 0, 0);
  EXPECT_EQ(faultOf(START + "G68 X5 Y5\nM30\n"),
            "part.nc: line 3, column 1: G68 without R, expected the angle in degrees");
  EXPECT_EQ(faultOf(START + "G68 R30\nG28 X0\nM30\n"),
            "part.nc: line 4, column 1: G28 of X or Y under G68, expected G69 before it");
}

TEST(ProgramReader, InverseTimeFeed) {
  const auto moves = movesOf(START + "G93 G1 X30 F2\nX40 F6\nG94 X50 F100\nM30\n");
  EXPECT_NEAR(moves[0].feed, 30 * MM * 2 / 60, 1e-12);
  EXPECT_NEAR(moves[1].feed, 10 * MM * 6 / 60, 1e-12);
  EXPECT_NEAR(moves[1].feed_word.unit * 6, moves[1].feed, 1e-15);
  EXPECT_NEAR(moves[2].feed, 0.1 / 60, 1e-12);
  EXPECT_EQ(faultOf(START + "G93 G1 X30 F2\nX40\nM30\n"),
            "part.nc: line 4, column 1: G1 without a feed, expected F in each block of G93");
}

TEST(ProgramReader, TappingAndBoring) {
  const auto upwards = [](const std::string& cycle) {  // [m/s] first move out of the hole, [s] dwell
    const auto moves = movesOf("G90 G0 X0 Y0 Z10\nS1000 M3\nG98 " + cycle + "\nG80\nM30\n");
    std::array<double, 3> seen{};
    for (const Move& move : moves) {
      if (move.path.target()[2] < -4.9 * MM) seen[1] = move.dwell;
      if (move.path.start()[2] < -4.9 * MM) seen[0] = move.rapid ? -1.0 : move.feed;
      if (move.path.start()[2] < -4.9 * MM) seen[2] = move.path.target()[2] / MM;
    }
    return seen;
  };
  for (const std::string code : {"G84", "G74", "G89"}) {
    const auto seen = upwards(code + " X1 Y1 Z-5 R2 P500 F600");
    EXPECT_NEAR(seen[0], 0.01, 1e-12) << code;
    EXPECT_NEAR(seen[1], 0.5, 1e-12) << code;
    EXPECT_NEAR(seen[2], 2.0, 1e-9) << code;
  }
  EXPECT_NEAR(upwards("G85 X1 Y1 Z-5 R2 F600")[0], 0.01, 1e-12);
  EXPECT_EQ(upwards("G86 X1 Y1 Z-5 R2 F600")[0], -1.0);
  EXPECT_EQ(upwards("G76 X1 Y1 Z-5 R2 Q0.2 P100 F600")[0], -1.0);
  EXPECT_EQ(faultOf("G90 G0 X0 Y0 Z10\nS1000 M3\nG98 G87 X1 Y1 Z-5 R-8 Q1 F600\nM30\n"),
            "part.nc: line 3, column 5: G87: back boring leaves an undercut, which the stock cannot have");
  // Chip breaking: no way out of the hole between the pecks.
  double highest = -1.0;
  bool inside = false;
  for (const Move& move : movesOf("G90 G0 X0 Y0 Z10\nS1000 M3\nG99 G73 X1 Y1 Z-5 R1 Q2 F600\nG80\nM30\n")) {
    inside = inside || move.path.target()[2] < 0.0;
    if (inside && move.path.target()[2] < 0.9 * MM) highest = std::max(highest, move.path.target()[2]);
  }
  EXPECT_NEAR(highest, -0.75 * MM, 1e-9);
}

TEST(ProgramReader, UnknownPositionAfterTheReferencePoint) {
  const auto moves = movesOf(START + "G91 G28 Z0\nG90 G0 X50 Y50\nZ10\nG1 Z-1 F100\nM30\n");
  ASSERT_EQ(moves.size(), 1u);
  expectPoint(moves[0].path.start(), 50, 50, 10);
  EXPECT_EQ(faultOf(START + "G28\nG1 X5 F100\nM30\n"),
            "part.nc: line 4, column 1: G1 from an unknown position of X, expected G0 to X, Y and Z first");
}

TEST(ProgramReader, DrillingCycles) {
  const auto moves =
      movesOf("G90 G0 X0 Y0 Z10\nS1000 M3\nG99 G81 X10 Y10 Z-5 R2 F100\nX20\nG98 X30\nG80\nM30\n");
  std::vector<double> bottoms, tops;
  for (const Move& move : moves) {
    if (!move.rapid) {
      EXPECT_NEAR(move.path.start()[2], 2 * MM, 1e-12);
      expectPoint(move.path.target(), 10.0 * (bottoms.size() + 1), 10, -5);
      bottoms.push_back(move.path.target()[2]);
    } else if (move.path.start()[2] < 0.0) {
      tops.push_back(move.path.target()[2] / MM);
    }
  }
  EXPECT_EQ(bottoms.size(), 3u);
  ASSERT_EQ(tops.size(), 3u);
  EXPECT_NEAR(tops[0], 2.0, 1e-9);   // G99
  EXPECT_NEAR(tops[2], 10.0, 1e-9);  // G98

  // Three pecks of 2 mm to -5 from 1: feed to -1, -3, -5.
  std::vector<double> pecks;
  for (const Move& move : movesOf("G90 G0 X0 Y0 Z10\nS1000 M3\nG83 Z-5 R1 Q2 F100\nM30\n"))
    if (!move.rapid) pecks.push_back(move.path.target()[2] / MM);
  ASSERT_EQ(pecks.size(), 3u);
  EXPECT_NEAR(pecks[0], -1.0, 1e-9);
  EXPECT_NEAR(pecks[1], -3.0, 1e-9);
  EXPECT_NEAR(pecks[2], -5.0, 1e-9);

  // Incremental holes: four at 5, 10, 15, 20; R and Z from the initial level.
  std::vector<double> x;
  for (const Move& move : movesOf("G90 G0 X0 Y0 Z10\nS1000 M3\nG91 G82 X5 Z-4 R-8 P500 K4 F100\nM30\n"))
    if (!move.rapid) {
      x.push_back(move.path.target()[0] / MM);
      EXPECT_NEAR(move.path.target()[2], -2 * MM, 1e-9);
      EXPECT_NEAR(move.dwell, 0.5, 1e-12);
    }
  ASSERT_EQ(x.size(), 4u);
  EXPECT_NEAR(x[3], 20.0, 1e-9);
}

TEST(ProgramReader, Subprograms) {
  const std::string text =
      "O1\nG90 G0 X0 Y0 Z0\nS1000 M3\nF100\nM98 P100 L2\nM98 P30200\nM30\nO100\nG91 G1 X1\nM98 "
      "P200\nM99\nO0200\nG91 G1 "
      "Y1\nM99\n";
  const auto moves = movesOf(text);
  ASSERT_EQ(moves.size(), 7u);  // 2 of X, 2 + 3 of Y
  expectPoint(moves.back().path.target(), 2, 5, 0);
  EXPECT_EQ(moves[0].line, 9);
  EXPECT_NE(moves[0].block, moves[2].block);  // the same line, executed twice
}

TEST(ProgramReader, NamesLineAndWordOfAFault) {
  struct Case {
    std::string text, fault;
  };
  for (const Case& c : std::vector<Case>{
           {"", "part.nc: no block, expected an NC program"},
           {START + "G1 X10 F100\n", "part.nc: line 3: the program ends in the middle, expected M30 or M2"},
           {"O1\n" + START + "O2\nM99\n",
            "part.nc: line 3: the program ends in the middle, expected M30 or M2"},
           {"O1\nM98 P2\nM30\nO2\nG90\n", "part.nc: line 5: the subprogram ends in the middle, expected M99"},
           {START + "G41 D1 X5\nM30\n",
            "part.nc: line 3, column 1: G41: radius offset D1 is unknown, expected it in the options or the "
            "model "
            "of the tool"},
           {START + "G0 X5 A90\nM30\n",
            "part.nc: line 3, column 7: unknown word A90, expected O, :, N, G, X, Y, Z, I, J, K, R, P, Q, L, "
            "H, D, T, F, S or M"},
           {START + "M88\nM30\n", "part.nc: line 3, column 1: unknown word M88"},
           {START + "G1 X1..2 F100\nM30\n", "part.nc: line 3, column 4: X1..2, expected a number"},
           {START + "G1 X#5041\nM30\n",
            "part.nc: line 3, #5041 is not supported, expected #1 to #33, #100 to #199 or #500 to #999"},
           {START + "G1 X10\nM30\n",
            "part.nc: line 3, column 1: G1 without a feed, expected F in or before this block"},
           {START + "G95 G1 X10\nM30\n",
            "part.nc: line 3, column 5: G1 without a feed, expected F in G95 in or before this block"},
           {START + "G2 X10 Y0 I5.1 J0 F100\nM30\n",
            "part.nc: line 3, column 1: arc does not close: radius 5.1000 mm at its start, 4.9000 mm at its "
            "end, expected "
            "equal radii"},
           {START + "G2 X10 Y0 R4 F100\nM30\n",
            "part.nc: line 3, column 1: arc does not close: R4.0000 mm is below half of the distance of its "
            "ends, 5.0000 mm"},
           {START + "G2 X10 F100\nM30\n",
            "part.nc: line 3, column 1: G2 without a centre, expected R or I, J, K of its plane"},
           {START + "G2 X0 Y0 R4 F100\nM30\n",
            "part.nc: line 3, column 1: arc with R from a point to itself, expected I, J or K for a full "
            "circle"},
           {START + "G20 X1\nM30\n",
            "part.nc: line 3, column 1: G20 after lengths in mm, expected one unit in the whole program"},
           {"G0 X1\nG20\nM30\n",
            "part.nc: line 2, column 1: G20 after lengths in mm, expected one unit in the whole program"},
           {"G54 G0 X0 Y0 Z0\nG55 X1\nM30\n",
            "part.nc: line 2, column 1: G55 after G54: its offset is unknown, expected --work-offset "
            "G55:X:Y:Z"},
           {START + "G1 G2 X1\nM30\n", "part.nc: line 3, column 4: G2 and G1 in one block"},
           {START + "G81 G0 X1 Z-1 R1 F100\nM30\n", "part.nc: line 3, column 5: G81 and G0 in one block"},
           {START + "G1 X1 X2 F1\nM30\n", "part.nc: line 3, column 7: two words X in one block"},
           {START + "G1 X1 Q2 F1\nM30\n", "part.nc: line 3, column 7: Q2 without a code that uses it"},
           {"X5 Y5\nM30\n",
            "part.nc: line 1, column 1: axis words without a motion, expected G0, G1, G2 or G3"},
           {START + "G81 X5 Z-5 F100\nM30\n", "part.nc: line 3, column 1: G81 without R, expected R and Z"},
           {START + "G83 X5 Z-5 R1 F100\nM30\n",
            "part.nc: line 3, column 1: G83 without Q, expected the depth of a peck"},
           {START + "G4\nM30\n", "part.nc: line 3, column 1: G4 without a time, expected P in ms or X in s"},
           {START + "M6\nM30\n", "part.nc: line 3, column 1: M6 without a tool, expected T"},
           {"M98 P7\nM30\n", "part.nc: line 1, column 5: P7: subprogram O7 is not in the file"},
           {"M99\n", "part.nc: line 1, column 1: M99 in the main program, expected M30 or M2"},
           {"O1\nM98 P1\nM30\n", "part.nc: line 2, column 1: more than 10 subprograms within each other"},
           {"O1\nM30\nO1\n", "part.nc: line 3: program O1 a second time, expected each number once"},
           {START + "G83 Z-9 R1 Q0.000001 F100\nM30\n",
            "part.nc: line 3, column 1: G83 with more than 9999 pecks"},
           {"(open\nM30\n", "part.nc: line 1, column 1: comment is not closed, expected ')'"}}) {
    EXPECT_EQ(faultOf(c.text), c.fault) << c.text;
  }
  EXPECT_THAT(errorOf([] { readProgram("nowhere.nc"); }), HasSubstr("nowhere.nc"));
}

// Changed, dropped and doubled characters of a valid program: moves or one line.
TEST(ProgramReader, AnyTextIsMovesOrAnErrorOfOneLine) {
  const std::string good = "O1\nT1 M6\n" + START +
                           "G1 X10 F100\nG2 X20 I5 (arc)\nG18 G3 X30 Z-5 R8\nG17 G91 G83 X1 Z-4 R-1 Q1 "
                           "K3\nG80 G90\nM98 P2 L2\nG28 "
                           "Z0\nM30\nO2\nG95 F.1 G1 X5\nG4 P100\nM99\n";
  ASSERT_EQ(faultOf(good), "");
  const std::string letters = "0123456789.-+GXYZIJKRPQLHTFSMNO:;()#%/ \n";
  std::mt19937 random(1);
  const auto upTo = [&](std::size_t most) {
    return std::uniform_int_distribution<std::size_t>(0, most)(random);
  };
  std::size_t faults = 0;
  for (int k = 0; k < 5000; ++k) {
    std::string text = good;
    for (std::size_t changes = 1 + upTo(3); changes > 0; --changes) {
      const std::size_t at = upTo(text.size() - 1), kind = upTo(2);
      if (kind == 0) text[at] = letters[upTo(letters.size() - 1)];
      if (kind == 1) text.erase(at, 1);
      if (kind == 2) text.insert(at, 1, letters[upTo(letters.size() - 1)]);
    }
    const std::string fault = faultOf(text);
    faults += !fault.empty();
    EXPECT_EQ(fault.find('\n'), std::string::npos) << text;
    if (!fault.empty()) {
      EXPECT_EQ(fault.rfind("part.nc: ", 0), 0u) << fault;
    }
  }
  EXPECT_GT(faults, 1000u);
}

}  // namespace
}  // namespace smartmill::program
