#include "smartmill_cnc/motion/nc_program.h"

#include <gtest/gtest.h>

#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

MotionLimits limits() {
  MotionLimits l;
  l.travel = {{{-0.2, 0.3}, {-0.1, 0.1}, {-0.25, 0.0}}};
  l.max_feed = 0.1;  // 6000 mm/min
  l.max_spindle_speed = units::radPerSecFromRpm(12000.0);
  l.max_dwell = 10.0;
  return l;
}

NcCheck check(const std::string& program, const StartPosition& start = {}) {
  return checkProgram(program, start, limits(), {});
}

TEST(NcProgram, ThesisCommands) {
  // The commands of Dunwoody 7.1: a relative move down and back, and the orientation of the spindle.
  const NcCheck moves = check("G91\nG01F60Z-8.73\nZ8.73\n");
  EXPECT_EQ(moves.verdict, NcVerdict::good) << moves.message;
  EXPECT_EQ(moves.text, "G90\nG91\nG1 F60.000 Z-8.730\nZ8.730\n");
  EXPECT_NEAR(moves.end[2], 0.0, 1e-12);
  const NcCheck orient = check("#1133=1024\nM119\n");
  EXPECT_EQ(orient.verdict, NcVerdict::good);
  EXPECT_EQ(orient.text, "G90\n#1133=1024\nM119\n");
}

TEST(NcProgram, WholeDialect) {
  const NcCheck c = check(
      "(slot) N10 G90 G0 X10 Y-5.5\n\n"
      "n20 s6000 m3\nG4 P500\nG4X1.5\nG1 Z-2 F300 (down)\nG91 X50\nX-20 F600.5\nM5\nM30\n");
  EXPECT_EQ(c.verdict, NcVerdict::good) << c.message;
  EXPECT_EQ(
      c.text,
      "G90\nN10 G90 G0 X10.000 Y-5.500\nN20 S6000 M3\nG4 P500\nG4 X1.500\nG1 F300.000 Z-2.000\nG91 X50.000\n"
      "F600.500 X-20.000\nM5\nM5\n");
  EXPECT_NEAR(c.end[0], 0.040, 1e-12);
  EXPECT_NEAR(c.end[1], -0.0055, 1e-12);
  EXPECT_NEAR(c.end[2], -0.002, 1e-12);
}

/// A controller may report a position as vacant.
TEST(NcProgram, NothingMovesFromAnUnknownPosition) {
  StartPosition start;
  start.machine[1] = start.absolute[1] = std::numeric_limits<double>::quiet_NaN();
  for (const char* program : {"G0 X1 Y1", "G91 G0 Y0.1"}) {
    const NcCheck c = check(program, start);
    EXPECT_EQ(c.verdict, NcVerdict::outside_limits) << program;
    EXPECT_EQ(c.message, std::string("line 1, column ") + (program[1] == '0' ? "7" : "8") +
                             ": the controller reports no position of Y");
  }
  EXPECT_EQ(check("G91 G0 X1\nS3000 M3\n", start).verdict, NcVerdict::good);
}

TEST(NcProgram, NotUnderstoodNamesTheLine) {
  struct Case {
    const char* program;
    const char* message;
  };
  for (const Case& c :
       {Case{"G90\nG2 X1 Y1\n", "line 2, column 1: unknown word G2, expected G0, G1, G4, G90 or G91"},
        Case{"G0 (above) X1 q3 Y2",
             "line 1, column 15: unknown word Q3, expected N, G, X, Y, Z, P, F, S or M"},
        Case{"T1 M6", "line 1, column 1: unknown word T1, expected N, G, X, Y, Z, P, F, S or M"},
        Case{"M6", "line 1, column 1: unknown word M6, expected M2, M3, M5, M30 or M119"},
        Case{"X1", "line 1, column 1: an axis word before G0 or G1"},
        Case{"G1 X1", "line 1, column 4: G1 before F"},
        Case{"G0 X1 X2", "line 1, column 7: two words X in one block"},
        Case{"G0 X1..2", "line 1, column 4: X1..2, expected a number"},
        Case{"G0 X", "line 1, column 4: X, expected a number"},
        Case{"G0 X1e3", "line 1, column 6: unknown word E3, expected N, G, X, Y, Z, P, F, S or M"},
        Case{"G0 X1234567890123", "line 1, column 4: X1234567890123, expected at most 12 digits"},
        Case{"G4", "line 1, column 1: G4 needs P in ms or X in s, alone"},
        Case{"G0 X1 (open", "line 1, column 7: comment is not closed, expected ')'"},
        Case{"G0 (a (b)", "line 1, column 7: '(' in a comment, expected ')' first"},
        Case{"G0 X1)", "line 1, column 6: ')' without '('"},
        Case{"#100=5", "line 1, column 1: #100 is the bridge's own variable"},
        Case{"#5=#6", "line 1, column 1: #5=, expected a number"},
        Case{"#5", "line 1, column 3: malformed block, expected #n=value"},
        Case{"#5=6 X1", "line 1, column 6: malformed block, expected #n=value"},
        Case{"IF[#1EQ1]GOTO10", "line 1, column 1: IF is not supported"},
        Case{"\n\n%\n", "line 3, column 1: unknown word %, expected N, G, X, Y, Z, P, F, S or M"},
        Case{"M30\nG0 X1", "line 2, column 1: a block after the end of the program"},
        Case{"G1 F0 X1", "line 1, column 4: F0: expected a feed above 0"},
        Case{"P5", "line 1, column 1: P without G4"},
        Case{"G4 P20000 M5.5", "line 1, column 11: M5.5, expected an integer from 0 to 999"},
        Case{"N1.5 G0 X1", "line 1, column 1: N1.5, expected an integer from 0 to 99999"}}) {
    const NcCheck result = check(c.program);
    EXPECT_EQ(result.verdict, NcVerdict::not_understood) << c.program;
    EXPECT_EQ(result.message, c.message);
    EXPECT_EQ(result.text, "");
  }
}

TEST(NcProgram, LimitsOfEveryAxisFeedAndSpeed) {
  for (const char* inside : {"G0 X300", "G0 X-200", "G0 Y100", "G0 Y-100", "G0 Z-250", "G0 Z0", "G1 X1 F6000",
                             "S12000 M3", "G4 X10"}) {
    EXPECT_EQ(check(inside).verdict, NcVerdict::good) << inside << ": " << check(inside).message;
  }
  for (const char* beyond : {"G0 X300.001", "G0 X-200.001", "G0 Y100.001", "G0 Y-100.001", "G0 Z-250.001",
                             "G0 Z0.001", "G1 X1 F6000.1", "S12001 M3", "G4 P10001"}) {
    EXPECT_EQ(check(beyond).verdict, NcVerdict::outside_limits) << beyond;
  }
  EXPECT_EQ(check("G0 X0\nG91\nX200\nX101\n").message,
            "line 4, column 1: X would go to 301 mm, limits -200 to 300 mm (machine)");
}

TEST(NcProgram, RelativeMovesStartAtTheCurrentPosition) {
  StartPosition start;
  start.machine = {0.25, 0.0, -0.1};
  start.absolute = start.machine;
  EXPECT_EQ(check("G91 G0 X50", start).verdict, NcVerdict::good);
  EXPECT_EQ(check("G91 G0 X50.1", start).verdict, NcVerdict::outside_limits);
  // Returning to a valid position does not excuse leaving the limits in between.
  EXPECT_EQ(check("G91 G0 Z-150\nZ150", start).verdict, NcVerdict::good);
  EXPECT_EQ(check("G91 G0 Z-151\nZ151", start).verdict, NcVerdict::outside_limits);
}

TEST(NcProgram, AbsoluteWordsAreWorkpieceCoordinates) {
  StartPosition start;
  start.machine = {0.1, 0.0, -0.1};
  start.absolute = {0.0, 0.0, 0.0};  // workpiece zero at machine x 100 mm
  EXPECT_EQ(check("G0 X200", start).verdict, NcVerdict::good);
  EXPECT_EQ(check("G0 X201", start).verdict, NcVerdict::outside_limits);
  EXPECT_NEAR(check("G0 X150", start).end[0], 0.25, 1e-12);
}

TEST(NcProgram, Jogs) {
  EXPECT_EQ(jogProgram(2, -0.00873, 0.001, 3), "G91 G1 F60.000 Z-8.730\n");
  EXPECT_EQ(jogProgram(0, 0.0123456, 0.0, 4), "G91 G0 X12.3456\n");
  EXPECT_EQ(fixedDecimals(-0.0001, 3), "0.000");
  EXPECT_EQ(fixedDecimals(-0.001, 3), "-0.001");
}

TEST(NcProgram, OrientAngles) {
  // 4096 steps a turn; angles outside one turn wrap.
  for (const auto& [angle, steps] : {std::pair<double, int>{0.0, 0},
                                     {units::PI / 2.0, 1024},
                                     {units::TWO_PI, 0},
                                     {-units::PI / 2.0, 3072},
                                     {5.0 * units::PI, 2048},
                                     {units::TWO_PI * 4095.6 / 4096.0, 0}}) {
    EXPECT_EQ(orientProgram(angle, 1133), "#1133=" + std::to_string(steps) + "\nM119\n");
  }
}

TEST(NcProgram, LimitsAreValidated) {
  MotionLimits l = limits();
  l.travel[1] = {0.1, -0.1};
  EXPECT_THROW(l.validate(), Error);
  l = limits();
  l.max_feed = 0.0;
  try {
    l.validate();
    FAIL();
  } catch (const Error& e) {
    EXPECT_STREQ(e.what(), "max_feed: 0 is out of range (> 0 m/s)");
  }
}

}  // namespace
}  // namespace smartmill::cnc
