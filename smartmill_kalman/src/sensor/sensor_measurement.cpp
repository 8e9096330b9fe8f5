#include "smartmill_kalman/sensor/sensor_measurement.h"

#include <algorithm>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/hit_check.h"
#include "smartmill_core/signal/same_time.h"
#include "smartmill_kalman/sensor/block_channels.h"
#include "tap_evaluation.h"

namespace smartmill::kalman {
void TapParameters::validate() const {
  checkBounds(*this);
  validateHitTest();
}

SensorMeasurement::SensorMeasurement(const TapParameters& parameters)
    : parameters_((parameters.validate(), parameters)),
      collector_({parameters.trigger_force, parameters.pre_trigger, parameters.record_length}),
      pairs_(parameters.strike_timeout) {
}

void SensorMeasurement::reset() {
  active_ = waiting_for_hit_ = false;
  collector_.reset();
  pairs_.clear();
  hits_.clear();
  command_.reset();
  feedback_.reset();
  finished_.reset();
}

std::optional<StrikeCommand> SensorMeasurement::takeCommand() {
  return std::exchange(command_, std::nullopt);
}
std::optional<TapFeedback> SensorMeasurement::takeFeedback() {
  return std::exchange(feedback_, std::nullopt);
}
std::optional<SensorResult> SensorMeasurement::takeResult() {
  return std::exchange(finished_, std::nullopt);
}

void SensorMeasurement::reportStage(const std::string& stage) {
  feedback_ = TapFeedback{stage, 0.95 * static_cast<double>(hits_.size()) / goal_.hits,
                          static_cast<int>(hits_.size())};
}

bool SensorMeasurement::handle(const MeasureFrfGoal& goal) {
  if (active_) return false;
  reset();
  goal_ = goal;
  bad_hits_ = 0;
  result_ = SensorResult();
  active_ = true;
  if (goal.point != POINT_FORCE_SENSOR) {
    finish(FrfCode::bad_goal, "point '" + goal.point + "': this node measures " + POINT_FORCE_SENSOR);
  } else if (!axisIndex(goal.direction)) {
    finish(FrfCode::bad_goal, "direction '" + goal.direction + "': expected x, y or z");
  } else if (goal.hits < 1 || goal.hits > 1000) {
    finish(FrfCode::bad_goal, "hits " + std::to_string(goal.hits) + ": expected 1..1000");
  } else if (goal.modes < 0 || goal.modes > 20) {
    finish(FrfCode::bad_goal, "modes " + std::to_string(goal.modes) + ": expected 0..20");
  } else {
    // Samples before the first hit fill the pre-trigger part of the record.
    rest_until_ = goal.stamp + std::max(parameters_.rest_time, 2.0 * parameters_.pre_trigger);
    reportStage("waiting for samples");
  }
  return true;
}

void SensorMeasurement::handleHammer(const SampleBlock& block) {
  if (!active_) return;
  pairs_.addHammer(block);
  handlePairs();
}

void SensorMeasurement::handleSensor(const SampleBlock& block) {
  if (!active_) return;
  const std::size_t c = columnOf(block, "f" + goal_.direction, "N");
  for (std::size_t i = 0; i < block.size(); ++i)
    pairs_.addResponse(block.timeOf(i), block.first_index + i, block.sample_rate, {block.at(i, c)});
  handlePairs();
}

// A sample lost by one stream is a gap in the index, which the collector detects.
void SensorMeasurement::handlePairs() {
  while (active_) {
    const std::optional<TapPairs::Pair> pair = pairs_.next();
    if (!pair) break;
    addSample(pair->time, pair->index, pair->rate, pair->force, pair->response[0]);
  }
  if (active_ && !pairs_.fault().empty()) finish(FrfCode::bad_data, pairs_.fault());
}

void SensorMeasurement::addSample(double time, std::uint64_t index, double rate, double force,
                                  double response) {
  if (time < goal_.stamp - SAME_TIME) return;
  auto record = collector_.add(time, index, rate, force, response);
  if (record) return handleRecord(time, std::move(*record));
  if (!waiting_for_hit_) {
    if (time >= rest_until_ - SAME_TIME) requestHit(time);
  } else if (time > deadline_ && !collector_.recording()) {
    collector_.disarm();
    rejectHit(time, formatted("no hit within %.1f s", parameters_.strike_timeout), false);
  }
}

void SensorMeasurement::requestHit(double now) {
  waiting_for_hit_ = true;
  deadline_ = now + parameters_.strike_timeout;
  collector_.arm();
  command_ = StrikeCommand{now, goal_.direction};
  reportStage("waiting for hit " + std::to_string(hits_.size() + 1) + " of " + std::to_string(goal_.hits));
}

void SensorMeasurement::hitByHand() {
  if (active_) reportStage("hit the workpiece by hand in " + goal_.direction);
}

void SensorMeasurement::handleRecord(double now, HitCollector::Record record) {
  HitFault fault{record.fault, true};
  if (fault.text.empty()) {
    fault = hitFault(record.hit,
                     {parameters_.weak_force, parameters_.second_hit_share, parameters_.response_range, 0.0});
  }
  if (!fault.text.empty()) return rejectHit(now, fault.text, fault.bad_data);
  bad_hits_ = 0;
  hits_.push_back(std::move(record.hit));
  if (static_cast<int>(hits_.size()) >= goal_.hits) {
    result_ = evaluateTaps(hits_, goal_, parameters_);
    return finish(result_.code, result_.message);
  }
  reportStage("hit " + std::to_string(hits_.size()) + " of " + std::to_string(goal_.hits));
  waiting_for_hit_ = false;
  rest_until_ = now + parameters_.rest_time;
}

void SensorMeasurement::rejectHit(double now, const std::string& why, bool bad_data) {
  if (++bad_hits_ > parameters_.max_bad_hits) {
    return finish(bad_data ? FrfCode::bad_data : FrfCode::no_hit,
                  std::to_string(bad_hits_) + " rejected hits in a row, the last: " + why);
  }
  reportStage("rejected hit: " + why);
  waiting_for_hit_ = false;
  rest_until_ = now + parameters_.rest_time;
}

void SensorMeasurement::end(FrfCode code, const std::string& message) {
  if (active_) finish(code, message);
}

void SensorMeasurement::finish(FrfCode code, const std::string& message) {
  result_.code = code;
  result_.message = message;  // may be that of pairs_
  active_ = waiting_for_hit_ = false;
  collector_.disarm();
  pairs_.clear();
  finished_ = std::move(result_);
  result_ = SensorResult();
}

}  // namespace smartmill::kalman
