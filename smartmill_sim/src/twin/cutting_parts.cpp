#include "smartmill_sim/twin/cutting_parts.h"

namespace smartmill::sim {

CuttingParts::CuttingParts(const MachineModel& original, const TwinSetup& setup, double step, Feed feed,
                           int corner_slices)
    : model(setup.model),
      time_step(step),
      timeline(original, setup.model),
      cut(setup, timeline.state().law, step, feed, corner_slices),
      chain(setup, step) {
}

void CuttingParts::update(const ToolMotion& motion) {
  timeline.update(motion, cut.contact.progress());
  cut.update(timeline.state());
  chain.update(timeline.state());
}

void CuttingParts::beginStep(const CuttingInput& input) {
  if (timeline.beginStep(input.motion.speed)) {
    update(input.motion);
    if (cut.contact.depthsChange(timeline.state())) cut.updateDepths(timeline.state());
  }
  const bool cuts = cut.contact.cutting() && input.motion.speed != 0.0;
  timeline.setInstant(input.motion, input.axis_acceleration,
                      cuts ? cut.contact.chip(input.motion, model.tool->teeth) : 0.0,
                      cuts ? cut.contact.depth() : 0.0);
}

void CuttingParts::endSteps(const ToolMotion& motion, std::size_t steps) {
  const double time = static_cast<double>(steps) * time_step;
  timeline.advance(time, cut.contact.cutting());
  cut.contact.advance(time, motion, timeline.state());
}

}  // namespace smartmill::sim
