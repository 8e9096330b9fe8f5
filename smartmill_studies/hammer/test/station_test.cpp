#include "hammer/station_score.h"

#include <gtest/gtest.h>

#include "hammer/station_draw.h"

namespace smartmill::hammer {
namespace {

TEST(Station, TheSameArgumentsGiveTheSameMachine) {
  const DrawnStation a = drawStation(5, 3), b = drawStation(5, 3), c = drawStation(5, 4);
  EXPECT_EQ(a.mounting, b.mounting);
  EXPECT_EQ(a.traits.spindle_frequency, b.traits.spindle_frequency);
  EXPECT_NE(a.mounting, c.mounting);
}

}  // namespace
}  // namespace smartmill::hammer
