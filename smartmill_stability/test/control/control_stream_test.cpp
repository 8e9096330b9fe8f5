#include "smartmill_stability/control/control_stream.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability_testing/control_streams.h"

namespace smartmill::stability {
namespace {

struct Played {
  std::vector<double> commands;
  std::vector<LearntMachine> learnt;
};

Played play(const TurningProcess& process, const std::vector<SampleBlock>& blocks) {
  Played played;
  ControlStream stream(ControlStreamParameters(),
                       [&](const LearntMachine& m) { played.learnt.push_back(m); });
  stream.handle(SpindleAngle{99.0, 0.0, units::TWO_PI / process.period});
  for (const SampleBlock& block : blocks) {
    const auto commands = stream.handle(block);
    if (!commands) continue;
    EXPECT_EQ(commands->first_index, block.first_index);
    EXPECT_EQ(commands->stamp, block.stamp);
    played.commands.insert(played.commands.end(), commands->samples.begin(), commands->samples.end());
  }
  return played;
}

TEST(ControlStream, resultsDoNotDependOnTheSizeOfTheBlocks) {
  const TurningProcess process = kimProcess(2.0);
  const Played fine = play(process, displacementBlocks(process, 2.1, 100));
  const Played coarse = play(process, displacementBlocks(process, 2.1, 250));
  ASSERT_EQ(fine.learnt.size(), 1u);
  EXPECT_TRUE(fine.learnt[0].informed);
  EXPECT_NEAR(fine.learnt[0].machine.frequency, 350.0, 3.5);
  EXPECT_NEAR(fine.learnt[0].machine.damping_ratio, 0.02, 0.004);
  EXPECT_NEAR(fine.learnt[0].stamp, 100.0 + 2.048, 2e-3);
  EXPECT_EQ(fine.commands, coarse.commands);
  EXPECT_EQ(fine.commands.front(), 0.0);
  EXPECT_NE(fine.commands.back(), 0.0);
}

TEST(ControlStream, aGapRestartsTheEstimateAndCommandsRequireASpeed) {
  const TurningProcess process = kimProcess(2.0);
  std::vector<SampleBlock> blocks = displacementBlocks(process, 2.1, 100);
  for (std::size_t i = 100; i < blocks.size(); ++i) blocks[i].first_index += 7;
  EXPECT_TRUE(play(process, blocks).learnt.empty());
  ControlStream stream(ControlStreamParameters(), {});
  EXPECT_FALSE(stream.handle(blocks[0]));  // unknown speed
  stream.handle(SpindleAngle{99.0, 0.0, 60.0});
  EXPECT_TRUE(stream.handle(blocks[0]));
}

TEST(ControlStream, refusesInvalidBlocksAndParameters) {
  ControlStream stream(ControlStreamParameters(), {});
  SampleBlock block = displacementBlocks(kimProcess(1.0), 0.01, 100)[0];
  block.units[0] = "V";
  EXPECT_THROW(stream.handle(block), Error);
  block.channels[0] = "other";
  EXPECT_THROW(stream.handle(block), Error);
  ControlStreamParameters parameters;
  parameters.controller.margin = -0.7;
  EXPECT_THROW(ControlStream(parameters, {}), Error);
}

}  // namespace
}  // namespace smartmill::stability
