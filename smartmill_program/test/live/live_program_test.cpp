// Steady stretches against the geometry of their cuts.

#include "smartmill_program/live/live_program.h"

#include <cmath>

#include <gmock/gmock.h>

#include "smartmill_core/error.h"
#include "test_part.h"

namespace smartmill::program {
namespace {

using units::degFromRad;
using units::MM;
using units::PI;

constexpr double STEP = 0.3125;  // [mm] of a tool of 10 mm

/// A slot, one step of 3 mm up and one down, with the way back in air.
const char* const SHOULDER =
    "G21 G90 G17 S3000 M3 F600\n"
    "G0 X-10 Y10 Z5\n"  // 2
    "G1 Z-2\n"          // 3
    "G1 X70\n"          // 4: slot
    "G1 Y13 F1200\n"    // 5: outside of the stock
    "G1 X-10 F600\n"    // 6: down-milling
    "G1 Y16\n"          // 7
    "G1 X70\n"          // 8: up-milling
    "G0 Z5\n"
    "M30\n";

std::vector<SteadyStretch> cutsOf(const LiveProgram& program) {
  std::vector<SteadyStretch> cuts;
  for (const SteadyStretch& stretch : program.stretches)
    if (stretch.cut) cuts.push_back(stretch);
  return cuts;
}

TEST(SteadyStretches, AreTheConstantEngagementsOfAShoulder) {
  const LiveProgram program = prepareText(SHOULDER);
  const std::vector<SteadyStretch> cuts = cutsOf(program);
  ASSERT_EQ(cuts.size(), 3u);
  // Of a step of 3 mm, the immersion of the wall: cos = 1 - 3 / 5.
  const double wall = degFromRad(std::acos(0.4));
  const double entry[] = {0.0, 180.0 - wall, 0.0}, exit[] = {180.0, 180.0, wall};
  const int line[] = {4, 6, 8};
  // The front half of the tool is in the stock from its first edge on; the arc changes as soon as the front
  // reaches the other edge.
  const double first[] = {0.0, 60.0, 0.0}, way[] = {1.0, -1.0, 1.0};
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(program.path.moves()[cuts[k].move].line, line[k]);
    EXPECT_NEAR(degFromRad(cuts[k].engagement.entry), entry[k], 0.05) << k;
    EXPECT_NEAR(degFromRad(cuts[k].engagement.exit), exit[k], 0.05) << k;
    EXPECT_NEAR(cuts[k].engagement.axial_depth, 2 * MM, 1e-9);
    EXPECT_NEAR(cuts[k].engagement.feed_per_tooth, 0.05 * MM, 1e-9);  // 600 mm/min, 3000 rpm, four teeth
    EXPECT_EQ(cuts[k].geometry.teeth, 4);
    // Margin: 0.1 s at 10 mm/s.
    EXPECT_NEAR(cuts[k].from[0] / MM, first[k] + way[k], 2.0 * STEP) << k;
    EXPECT_NEAR(cuts[k].from[2] / MM, -2.0, 1e-9);
    EXPECT_GT(cuts[k].steady_to, cuts[k].steady_from + 50 * MM);
  }
  // The front reaches the far edge where the centre is a radius before it.
  EXPECT_NEAR(cuts[0].to[0] / MM, 55.0 - 1.0, 2.0 * STEP);
  ASSERT_EQ(program.contact.size(), 3u);
  EXPECT_TRUE(program.cutsBetween(cuts[0].begin, cuts[0].end));
  EXPECT_FALSE(program.cutsBetween(0.0, 5 * MM));
}

TEST(SteadyStretches, AirIsFeedRapidAndDwellWithTheSpindleTurning) {
  const LiveProgram program = prepareText(
      "G21 G90 G17 S3000 M3 F600\n"
      "G0 X-10 Y10 Z5\n"
      "G4 X1.5\n"
      "G1 Z-2\n"
      "G1 X20\n"
      "G0 Z5\n"
      "G1 X30 F300\n"
      "S6000\n"
      "G1 X50\n"
      "M5\n"
      "G1 X70\n"
      "M30\n");
  std::vector<SteadyStretch> air;
  for (const SteadyStretch& stretch : program.stretches)
    if (!stretch.cut) air.push_back(stretch);
  ASSERT_EQ(air.size(), 3u);
  // Dwell 1.5 s, 7 mm down at 10 mm/s and 5 mm to the edge of the stock.
  EXPECT_NEAR(air[0].time, 1.5 + 0.7 + 0.5, 0.05);
  EXPECT_NEAR(air[1].time, 2.0, 0.05);  // 10 mm at 5 mm/s
  EXPECT_NEAR(air[2].time, 4.0, 0.05);
  EXPECT_NEAR(air[2].spindle_speed, 2.0 * air[1].spindle_speed, 1e-9);
  // It ends 0.1 s before the tool meets the stock, 12 mm from the start.
  EXPECT_NEAR(air[0].steady_to / MM, 12.0 - 1.0, 2.0 * STEP);
}

TEST(SteadyStretches, ArcsRampsAndShortCutsHaveNone) {
  // A ramp, an arc in full immersion, 5 mm of a slot in 0.5 s.
  const LiveProgram program = prepareText(
      "G21 G90 G17 S3000 M3 F600\n"
      "G0 X20 Y20 Z1\n"
      "G1 X30 Z-2\n"
      "G3 X30 Y30 I0 J5\n"
      "G1 X25\n"
      "G0 Z5\n"
      "M30\n");
  EXPECT_TRUE(cutsOf(program).empty());
  EXPECT_FALSE(program.contact.empty());
}

TEST(SteadyStretches, AProgramThatDoesNotFitItsStockIsRefused) {
  EXPECT_THAT(errorOf([] { prepareText("G21 G90 S3000 M3 F600\nG0 X-10 Y10 Z-2\nX20\nM30\n"); }),
              ::testing::StartsWith("part.nc: line 3: G0: a rapid move hits the stock"));
  EXPECT_THAT(errorOf([] { prepareText("G21 G90 S3000 M3 F600\nG0 X-10 Y10 Z5\nG1 X20\nM30\n"); }),
              ::testing::HasSubstr("no block meets the stock"));
}

}  // namespace
}  // namespace smartmill::program
