#include "smartmill_sim/twin/flexible_cut.h"

#include <string>

#include "smartmill_core/error.h"

namespace smartmill::sim {

FlexibleCut::FlexibleCut(const TwinSetup& setup, const CuttingLaw& law, double time_step, Feed feed,
                         int corner_slices)
    : tip_(setup.model.tool_tip, setup.model.workpieceModes(), 1.0 / time_step) {
  if (!setup.model.tool || !setup.model.cutting) return;
  radius_offset_ = setup.radius_offset;
  const bool tables = feed == Feed::steady && !vibrates();
  cutter_.emplace(*setup.model.tool, law, time_step, setup.radius_offset, setup.path_share,
                  tables ? Cutter::Method::tables : Cutter::Method::history, corner_slices);
  layers_ = EdgeLayers(setup, law, time_step, tables);
}

void FlexibleCut::update(const TwinState& state) {
  if (cutter_) cutter_->setLaw(state.law);
  layers_.setLaw(state.law);
}

void FlexibleCut::shortenTeeth(const std::vector<double>& shortening) {
  if (!cutter_ || shortening.size() != radius_offset_.size())
    throw Error("cutting: " + std::to_string(shortening.size()) + " teeth to shorten, expected " +
                std::to_string(radius_offset_.size()));
  std::vector<double> radius = radius_offset_;
  for (std::size_t j = 0; j < radius.size(); ++j) radius[j] -= shortening[j];
  cutter_->setRadii(radius);
  layers_.setRadii(radius);
}

void FlexibleCut::engage(const ToolMotion& now, const TwinState& state) {
  const std::vector<ContactArc> actual = contact.actualArcs(state);
  if (replaysTrace()) return;
  cutter_->engage(actual, contact.actualMotion(now, state));
  layers_.engage(actual, contact.actualMotion(now, state));
}

void FlexibleCut::updateDepths(const TwinState& state) {
  const std::vector<ContactArc> arcs = contact.actualArcs(state);
  if (!cutter_ || replaysTrace()) return;
  cutter_->setDepths(arcs);
  layers_.setDepths(arcs);
}

CuttingForce FlexibleCut::force(const Input& input, const TwinState& state) {
  if (replaysTrace()) return replayed_->steps.at(replay_index_).force;
  if (!cutter_) return {};
  if (rigid() && state.feed_ratio == 1.0) {
    CuttingForce sum = cutter_->step(input.motion);
    layers_.add(input.motion, sum);
    return sum;
  }
  ToolMotion motion = contact.actualMotion(input.motion, state);
  // The displacement of the tip depends on the force of this step and vice versa.
  TipMobility mobility;
  if (input.tip) {
    motion.displacement = input.tip->displacement;
    motion.rate = input.tip->rate;
  } else if (vibrates()) {
    mobility = tip_.predict(state.law.damping != 0.0, input.tip_force, motion);
  }
  CuttingForce sum;
  layers_.add(motion, sum);
  mobility.assumed_force[0] -= sum.fx;
  mobility.assumed_force[1] -= sum.fy;
  sum.add(cutter_->step(motion, mobility));
  return sum;
}

void FlexibleCut::moveTip(const Input& input, const CuttingForce& force, ChannelValues& channels) {
  if (rigid()) return;
  double acceleration = 0.0;
  if (replaysTrace()) {
    const CutTrace::Step& step = replayed_->steps.at(replay_index_++);
    channels[TOOL_X] = step.displacement[0];
    channels[TOOL_Y] = step.displacement[1];
    acceleration = step.acceleration;
  } else {
    integrateTip(input, force, channels);
    if (probe_) acceleration = tip_.acceleration(*probe_);
    if (recorded_ && !tip_prescribed_)
      recorded_->steps.push_back({force, {{channels[TOOL_X], channels[TOOL_Y]}}, acceleration});
  }
  if (!probe_) return;
  channels[DISPLACEMENT] = channels[TOOL_X + *probe_];
  channels[ACCELERATION] = acceleration;
}

void FlexibleCut::integrateTip(const Input& input, const CuttingForce& force, ChannelValues& channels) {
  std::array<double, 2> at{};
  if (vibrates()) {
    const double jump = contact.jump();
    const std::array<double, 2> now{{force.fx + input.tip_force[0], force.fy + input.tip_force[1]}};
    const std::array<double, 2> before{
        {now[0] - jump * (force.fx - last_.fx), now[1] - jump * (force.fy - last_.fy)}};
    // A jump is not extrapolated.
    const TipStructure::Displacement moved =
        tip_.step(before, now, input.tip_force, jump != 0.0, !contact.changed());
    channels[TOOL_X] = moved.tool[0];
    channels[TOOL_Y] = moved.tool[1];
    at = moved.relative;
  }
  if (!cutter_) return;
  if (input.tip) at = input.tip->displacement;
  cutter_->endStep(at);
  layers_.endStep(at);
}

void FlexibleCut::endStep(const CuttingForce& force) {
  last_ = force;
  contact.endStep();
}

void FlexibleCut::recordTrace(CutTrace* trace) {
  recorded_ = trace;
  if (tracesSums()) cutter_->recordSums(&trace->sums);
}

void FlexibleCut::replayTrace(const CutTrace* trace) {
  replayed_ = trace;
  if (tracesSums()) cutter_->replaySums(&trace->sums);
}

void FlexibleCut::reserveTrace(std::size_t steps) {
  if (recorded_) (tracesSums() ? recorded_->sums.reserve(steps) : recorded_->steps.reserve(steps));
}

void FlexibleCut::replay(std::size_t from, ForceHistory& history, const ChannelRows& rows) {
  std::vector<double>* const x = rows[TOOL_X];
  std::vector<double>* const y = rows[TOOL_Y];
  const std::size_t steps = history.force.size();
  if (replaysTrace()) {
    for (std::size_t k = from; k < steps; ++k) {
      const CutTrace::Step& step = replayed_->steps.at(replay_index_++);
      history.force[k] = step.force;
      if (x) (*x)[k] = step.displacement[0];
      if (y) (*y)[k] = step.displacement[1];
    }
  } else {
    const Input input;
    ChannelValues channels{};
    for (std::size_t k = from; k < steps; ++k) {
      history.force[k] = cutter_->step(input.motion);
      if (!vibrates() || !(x || y)) continue;
      integrateTip(input, history.force[k], channels);
      if (x) (*x)[k] = channels[TOOL_X];
      if (y) (*y)[k] = channels[TOOL_Y];
    }
  }
  last_ = history.force.back();
}

}  // namespace smartmill::sim
