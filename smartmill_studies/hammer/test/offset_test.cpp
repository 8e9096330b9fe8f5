#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "hammer/offset_cases.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_hammer/analysis/offset_factor.h"

namespace smartmill::studies {
namespace {

// Comparison with the plant, which shares no code with the correction. Required: gains within 3 % (median)
// and calibrated standard deviations; `rosrun smartmill_studies hammer_offset` runs more machines.
TEST(OffsetCorrection, IsRightForSpindleAndToolModes) {
  std::mt19937_64 random(3);
  std::vector<double> gains[TIP_METHODS], frfs[TIP_METHODS];
  int stated = 0, inside = 0;
  for (int i = 0; i < 12; ++i) {
    const OffsetCase drawn = drawOffsetCase(random);
    const OffsetOutcome outcome = judgeOffset(drawn, 0.005, random);
    for (int w = 0; w < TIP_METHODS; ++w) {
      frfs[w].push_back(outcome.frf_error[w]);
      for (const GainError& e : outcome.modes[w]) {
        if (e.share < 0.03) continue;
        gains[w].push_back(std::abs(e.error));
        if (w < 2) continue;
        ++stated;
        inside += std::abs(e.error) < 3.0 * e.std;
      }
    }
  }
  EXPECT_LT(median(gains[2]), 0.03);
  EXPECT_LT(median(gains[3]), 0.02);
  EXPECT_LT(median(gains[2]), 0.3 * median(gains[1]));  // eq. 4.44
  EXPECT_LT(median(gains[2]), 0.3 * median(gains[0]));  // none
  EXPECT_LT(median(frfs[2]), 0.03);
  EXPECT_GE(inside, 9 * stated / 10);
}

// Check of the plant with an almost rigid spindle: the tool is the cantilever of eq. 4.42 and 4.43, and its
// static compliance (sum of all modes) follows eq. 4.44.
TEST(OffsetCorrection, PlantIsTheThesisCantilever) {
  plant::ToolInSpindle t;
  t.stickout = 60e-3;
  t.shank_diameter = 12e-3;
  t.flute_ratio = 1.0;
  t.young = 5.8e11;
  t.density = 14300.0;
  t.spindle_mass = 1e4;
  t.spindle_inertia = 1e4;
  t.stiffness_across = 1e14;
  t.stiffness_tilting = 1e12;
  t.damping_ratio = 0.02;
  double direct = 0.0, cross = 0.0;
  for (const plant::CrossMode& m : plant::crossModes(t, 0.0, 0.0, 1e9)) direct += m.gain;
  for (const plant::CrossMode& m : plant::crossModes(t, 15e-3, 0.0, 1e9)) cross += m.gain;
  EXPECT_NEAR(direct / cross, hammer::offsetFactor(60e-3, 15e-3), 1e-3);
}

TEST(OffsetCorrection, NamesWhatIsWrong) {
  hammer::OffsetMeasurement at{15e-3, 0.0, {}};
  hammer::ToolBeam tool;
  EXPECT_THROW(hammer::correctToTip({at}, tool, {}, 5000.0), Error);  // no mode
  at.modes.modes = {{900.0, 0.03, 1e-8, 0.1, 1e-3, 1e-10}};
  EXPECT_THROW(hammer::correctToTip({at}, tool, {}, 5000.0), Error);  // no tool
  tool.stickout = {10e-3, 1e-4};
  tool.diameter = {12e-3, 1e-5};
  tool.fluted_length = {8e-3, 1e-4};
  EXPECT_THROW(hammer::correctToTip({at}, tool, {}, 5000.0), Error);  // struck above it
}

}  // namespace
}  // namespace smartmill::studies
