#include "twin/stage_run.h"

namespace smartmill::sim {

// Whether no effect changes the state from step to step or depends on the instant of a step.
bool StageRun::replaysWithoutUpdates() const {
  return cut_.replaysAlone() && !(effects_.has(Stage::motion) || effects_.has(Stage::cutting_law) ||
                                  effects_.has(Stage::sensor) || effects_.has(Stage::sensor_force) ||
                                  effects_.has(Stage::drive) || effects_.has(Stage::sensor_output));
}

void StageRun::run(std::size_t steps, const Next& next, const ChannelRows& raw) {
  // Channels that are not requested may act on requested ones.
  const bool mixes = effects_.has(Stage::sensor_output) || parts_.chain.mixes();
  std::array<std::vector<double>, LOAD_METER + 1> unrequested;
  ChannelRows rows = raw;
  for (std::size_t c = 0; c < unrequested.size() && mixes; ++c) {
    if (rows[c]) continue;
    unrequested[c].resize(steps);
    rows[c] = &unrequested[c];
  }
  History history;
  simulateCut(steps, next, rows, history);
  parts_.chain.measure(history, parts_.timeline.now().speed, rows);
  applyOutputEffects(history.instants, rows);
  parts_.chain.filter(steps, rows);
}

void StageRun::simulateCut(std::size_t steps, const Next& next, const ChannelRows& raw, History& history) {
  const bool has_sensor_force = effects_.has(Stage::sensor_force),
             has_output_effects = effects_.has(Stage::sensor_output);
  history.before = cut_.last();
  history.force.resize(steps);
  if (has_sensor_force) history.applied.resize(steps);
  if (has_output_effects) history.instants.resize(steps);
  cut_.reserveTrace(steps);
  CuttingInput input;
  ChannelValues tip{};
  const bool replays_rest = replaysWithoutUpdates();
  for (std::size_t k = 0; k < steps; ++k) {
    if (replays_rest && cut_.contact.cutting() && cut_.contact.jump() == 0.0) {
      cut_.replay(k, history, raw);
      next(steps - 1, input);
      parts_.timeline.setAngle(input.motion.angle);
      parts_.endSteps(input.motion, steps - k);
      return;
    }
    next(k, input);
    parts_.beginStep(input);
    if (has_output_effects) history.instants[k] = parts_.timeline.now();
    const CuttingForce force = history.force[k] = cut_.force(input, parts_.timeline.state());
    if (has_sensor_force) {
      history.applied[k] = {{force.fx, force.fy, force.fz}};
      effects_.addForce(parts_.timeline.now(), history.applied[k]);
    }
    cut_.moveTip(input, force, tip);
    for (const std::size_t c : {TOOL_X, TOOL_Y}) {
      if (raw[c]) (*raw[c])[k] = tip[c];
    }
    if (cut_.contact.jump() != 0.0) history.jumps.emplace_back(k, cut_.contact.jump());
    cut_.endStep(force);
    parts_.endSteps(input.motion);
  }
}

void StageRun::applyOutputEffects(const std::vector<Instant>& instants, const ChannelRows& raw) const {
  for (std::size_t k = 0; k < instants.size(); ++k) {
    ChannelValues values{};
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
      if (raw[c]) values[c] = (*raw[c])[k];
    }
    effects_.measure(Stage::sensor_output, instants[k], values);
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
      if (raw[c]) (*raw[c])[k] = values[c];
    }
  }
}

}  // namespace smartmill::sim
