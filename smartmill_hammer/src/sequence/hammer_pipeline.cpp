#include "smartmill_hammer/sequence/hammer_pipeline.h"

#include <utility>

#include "smartmill_core/names.h"

namespace smartmill::hammer {

HammerPipeline::HammerPipeline(const HammerParameters& parameters, const MachineModel& model,
                               double hold_back, Outputs outputs)
    : sequence_(parameters, model),
      outputs_(std::move(outputs)),
      sorter_(hold_back),
      events_(sorter_.addEvents(names::MEASURE_TOOL_FRF)),
      blocks_(sorter_.addRegular(names::HAMMER)),
      states_(sorter_.addRegular(names::CNC_STATE)),
      angles_(sorter_.addRegular(names::SPINDLE_ANGLE)) {
  sorter_.onRestart([this] {
    sequence_.reset();
    if (outputs_.restarted) outputs_.restarted();
  });
}

template <class Input>
void HammerPipeline::sort(StreamSorter::Stream stream, const Input& input) {
  sorter_.push(stream, input.stamp, [this, input] {
    sequence_.handle(input);
    drain();
  });
}

void HammerPipeline::push(const SampleBlock& hammer) {
  sort(blocks_, hammer);
}
void HammerPipeline::push(const CncState& state) {
  sort(states_, state);
}
void HammerPipeline::push(const SpindleAngle& angle) {
  sort(angles_, angle);
}

void HammerPipeline::push(const MeasureFrfGoal& goal, std::function<bool(bool)> begin) {
  sorter_.push(events_, goal.stamp, [this, goal, begin = std::move(begin)] {
    if (begin && !begin(!sequence_.isActive())) return;
    sequence_.handle(goal);
    drain();
  });
}

void HammerPipeline::cancel(std::function<bool()> applies) {
  sorter_.pushNow(events_, [this, applies = std::move(applies)] {
    if (applies()) sequence_.cancel(sorter_.newest());
    drain();
  });
}

void HammerPipeline::commandFailed(const std::string& text) {
  sorter_.pushNow(events_, [this, text] {
    sequence_.commandFailed(sorter_.newest(), text);
    drain();
  });
}

void HammerPipeline::inputLost(const std::string& text) {
  if (!sequence_.isActive()) return;
  sequence_.inputLost(sorter_.newest(), text);
  drain();
}

void HammerPipeline::drain() {
  for (const Command& command : sequence_.takeCommands()) {
    if (outputs_.command) outputs_.command(command);
  }
  if (const auto feedback = sequence_.takeFeedback(); feedback && outputs_.feedback)
    outputs_.feedback(*feedback);
  if (const auto result = sequence_.takeResult(); result && outputs_.result) outputs_.result(*result);
}

}  // namespace smartmill::hammer
