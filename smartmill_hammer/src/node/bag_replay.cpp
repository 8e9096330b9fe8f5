#include "bag_replay.h"

#include <cstdio>

#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/MeasureFrfActionGoal.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "hammer_server.h"
#include "parameters_ros.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_ros/bag_reader.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/goals.h"
#include "smartmill_ros/parameter_reader.h"

namespace smartmill {
namespace hammer {

BagReplay replayBag(const std::string& bag, const std::string& model, const std::string& parameter_file) {
  HammerParameters parameters;
  NodeParameters node;
  if (!parameter_file.empty()) {
    ParameterReader reader = ParameterReader::fromFile(parameter_file);
    readParameters(reader, parameters, node);
    reader.finish();
  }
  HammerSequence sequence(parameters, readMachineModel(model));
  BagReplay replay;
  replay.fit_low = parameters.fit_low;
  replay.fit_high = parameters.fit_high;
  const auto drain = [&] {
    sequence.takeCommands();  // the recorded streams answer them
    if (const auto feedback = sequence.takeFeedback()) std::fprintf(stderr, "%s\n", feedback->stage.c_str());
    if (auto result = sequence.takeResult()) replay.results.push_back(std::move(*result));
  };
  // The order of the streams is the node's: equal stamps must come in the same order.
  StreamSorter sorter(node.hold_back);
  const auto goals = sorter.addEvents("hammer/measure_frf"), blocks = sorter.addRegular("daq/hammer"),
             states = sorter.addRegular("cnc/state"), angles = sorter.addRegular("spindle/angle");
  BagReader reader(bag);
  reader.on<smartmill_msgs::MeasureFrfActionGoal>(
      "hammer/measure_frf/goal", [&](const smartmill_msgs::MeasureFrfActionGoal& m, double receive_stamp) {
        const MeasureFrfGoal goal = goalFromMsg(m.goal, receive_stamp);
        sorter.push(goals, goal.stamp, [&sequence, &drain, goal] { sequence.handle(goal), drain(); });
      });
  reader.on<smartmill_msgs::SampleBlock>("daq/hammer", [&](const smartmill_msgs::SampleBlock& m, double) {
    const SampleBlock block = fromMsg(m);
    sorter.push(blocks, block.stamp, [&sequence, &drain, block] { sequence.handle(block), drain(); });
  });
  reader.on<smartmill_msgs::CncState>("cnc/state", [&](const smartmill_msgs::CncState& m, double) {
    const CncState state = fromMsg(m);
    sorter.push(states, state.stamp, [&sequence, &drain, state] { sequence.handle(state), drain(); });
  });
  reader.on<smartmill_msgs::SpindleAngle>(
      "spindle/angle", [&](const smartmill_msgs::SpindleAngle& m, double) {
        const SpindleAngle angle = fromMsg(m);
        sorter.push(angles, angle.stamp, [&sequence, &drain, angle] { sequence.handle(angle), drain(); });
      });
  reader.run();
  sorter.flush();
  return replay;
}

}  // namespace hammer
}  // namespace smartmill
