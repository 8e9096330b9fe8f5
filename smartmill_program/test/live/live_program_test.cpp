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
    EXPECT_EQ(program.tools.at(cuts[k].tool).teeth, 4);
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

// The second ring of a circular pocket, of one and of two arcs. In the frame of the feed the centre of the
// pocket is on the left at 7 mm; the wall of the first ring is 9 mm from it: 25 + 49 - 70 cos(entry) = 81.
TEST(SteadyStretches, ARingOfAPocketIsOne) {
  const double entry = degFromRad(std::acos(-0.1)), length = units::TWO_PI * 7.0;
  for (const char* ring : {"G3 I-7\n", "G3 X23 Y20 I-7 J0\nG3 X37 Y20 I7 J0\n"}) {
    const LiveProgram program = prepareText(
        "G21 G90 G17 S3000 M3 F600\n"
        "G0 X30 Y20 Z1\n"
        "G1 Z-2\n"
        "G1 X34\n"
        "G3 I-4\n"
        "G1 X37\n" +
        std::string(ring) + "G0 Z5\nM30\n");
    std::vector<SteadyStretch> rings;
    for (const SteadyStretch& cut : cutsOf(program))
      if (program.path.moves()[cut.move].line == 7) rings.push_back(cut);
    ASSERT_EQ(rings.size(), 1u) << ring;
    EXPECT_TRUE(rings[0].turns);
    EXPECT_NEAR(degFromRad(rings[0].engagement.entry), entry, 0.1);
    EXPECT_NEAR(degFromRad(rings[0].engagement.exit), 180.0, 0.1);
    EXPECT_GT((rings[0].end - rings[0].begin) / MM, 0.7 * length);
    EXPECT_NEAR(std::hypot(rings[0].to[0] - 30 * MM, rings[0].to[1] - 20 * MM), 7 * MM, 1e-6);
  }
}

TEST(SteadyStretches, RampsHelicesAndShortCutsHaveNone) {
  // A ramp, a helix in full immersion, 5 mm of a slot in 0.5 s.
  const LiveProgram program = prepareText(
      "G21 G90 G17 S3000 M3 F600\n"
      "G0 X20 Y20 Z1\n"
      "G1 X30 Z-2\n"
      "G3 X30 Y30 Z-2.5 I0 J5\n"
      "G1 X25\n"
      "G0 Z5\n"
      "M30\n");
  EXPECT_TRUE(cutsOf(program).empty());
  EXPECT_FALSE(program.contact.empty());
}

// Raster of a ball with a step of 1 mm in a plane: the engagement changes over the height, by the closed form
// cos(exit) = 1 - step / r; along the line it stays the same.
TEST(SteadyStretches, ABallHasABandOfEachHeight) {
  const LiveProgram program = prepareText(
      "G21 G90 G17 S3000 M3 F600\n"
      "G0 X-10 Y10 Z5\n"
      "G1 Z-1\n"
      "G1 X70\n"  // 4: slot
      "G0 Z5\n"
      "G0 X-10 Y11\n"
      "G1 Z-1\n"
      "G1 X70\n"  // 8: the step
      "G0 Z5\n"
      "M30\n",
      {}, ", corner_radius_mm: 5.0");
  const std::vector<SteadyStretch> cuts = cutsOf(program);
  ASSERT_EQ(cuts.size(), 2u);
  EXPECT_TRUE(cuts[0].engagement.bands.empty());
  EXPECT_NEAR(cuts[0].engagement.axial_depth, 1 * MM, 2e-3 * MM);
  const Engagement& step = cuts[1].engagement;
  ASSERT_GT(step.bands.size(), 4u);
  EXPECT_GT(cuts[1].steady_to, cuts[1].steady_from + 50 * MM);
  // Torque sensitivities: integrals over the height of 1 - cos(exit) = step / r, and of exit.
  double chip = 0.0, edge = 0.0, chip_exact = 0.0, edge_exact = 0.0, bottom = 0.0;
  for (const EngagementBand& band : step.bands) {
    EXPECT_NEAR(band.bottom, bottom, 1e-9);
    bottom = band.top;
    chip += (band.top - band.bottom) * (std::cos(band.entry) - std::cos(band.exit));
    edge += (band.top - band.bottom) * (band.exit - band.entry);
  }
  constexpr int PARTS = 20000;
  for (int k = 0; k < PARTS; ++k) {
    const double height = (k + 0.5) / PARTS * MM, r = std::sqrt(height * (10 * MM - height));
    const double exit = std::acos(std::max(-1.0, 1.0 - 1 * MM / r));
    chip_exact += (1.0 - std::cos(exit)) * MM / PARTS;
    edge_exact += exit * MM / PARTS;
  }
  EXPECT_NEAR(bottom, 1 * MM, 2e-3 * MM);
  EXPECT_NEAR(chip / chip_exact, 1.0, 0.01);
  EXPECT_NEAR(edge / edge_exact, 1.0, 0.01);
}

TEST(SteadyStretches, AProgramThatDoesNotFitItsStockIsRefused) {
  EXPECT_THAT(errorOf([] { prepareText("G21 G90 S3000 M3 F600\nG0 X-10 Y10 Z-2\nX20\nM30\n"); }),
              ::testing::StartsWith("part.nc: line 3: G0: a rapid move hits the stock"));
  EXPECT_THAT(errorOf([] { prepareText("G21 G90 S3000 M3 F600\nG0 X-10 Y10 Z5\nG1 X20\nM30\n"); }),
              ::testing::HasSubstr("no block meets the stock"));
}

}  // namespace
}  // namespace smartmill::program
