#include "smartmill_hammer/sequence/hammer_sequence.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "controller_state.h"
#include "frf_evaluation.h"
#include "measurement.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/same_time.h"
#include "smartmill_core/units.h"
#include "station_control.h"
#include "step_runner.h"
#include "turned_station.h"

namespace smartmill::hammer {
namespace {

/// Fault of a tool that a hammer opposite the sensor cannot strike on a flute while another faces the sensor.
std::string oppositeFault(const HammerStation& station, const ToolGeometry& tool, int teeth,
                          double tolerance) {
  if (teeth % 2 != 0)
    return formatted(
        "teeth %d: expected an even number, the sensor is opposite the hammer and both face a flute", teeth);
  for (int k = 0; teeth == tool.teeth && k < teeth / 2; ++k) {
    const double between = tool.toothAngle(k + teeth / 2) - tool.toothAngle(k);
    if (std::abs(between - units::PI) > tolerance) {
      return formatted(
          "teeth %d and %d are %.1f deg apart: expected 180 +- %.1f deg, the sensor is opposite the hammer "
          "and both "
          "face a flute",
          k + 1, k + 1 + teeth / 2, units::degFromRad(between), units::degFromRad(tolerance));
    }
  }
  const double stroke = station.opposite->distance - station.gap_at_zero_volt - tool.diameter;
  if (stroke > 0.0 && stroke <= station.opposite->stroke) return {};
  return formatted("tool of %.1f mm: expected %.1f to %.1f mm between sensor and hammer", 1e3 * tool.diameter,
                   1e3 * (stroke + tool.diameter - station.opposite->stroke), 1e3 * (stroke + tool.diameter));
}

std::string goalFault(const MeasureFrfGoal& goal, const HammerParameters& parameters,
                      const MachineModel& model) {
  const HammerStation& station = *model.hammer;
  const std::optional<std::size_t> axis = axisIndex(goal.direction);
  const int teeth = goal.teeth > 0 ? goal.teeth : model.tool->teeth;
  const double struck = station.offset + parameters.read_height;
  if (goal.point != POINT_TOOL_TIP) return "point '" + goal.point + "': expected " + POINT_TOOL_TIP;
  if (station.position.count(goal.direction) == 0 || !axis || *axis > 1)
    return "direction '" + goal.direction + "': the model's hammer station has no such position";
  if (goal.hits < 1 || goal.hits > 1000) return "hits " + std::to_string(goal.hits) + ": expected 1..1000";
  if (goal.modes < 0 || goal.modes > 20) return "modes " + std::to_string(goal.modes) + ": expected 0..20";
  if (teeth < 1 || teeth > 20) return "teeth " + std::to_string(teeth) + ": expected 1..20";
  if (!(goal.stickout == 0.0 || (goal.stickout > struck && std::isfinite(goal.stickout))))
    return formatted("stickout %.2f mm: expected 0 or more than the height of the hammer, %.2f mm",
                     1e3 * goal.stickout, 1e3 * struck);
  if (station.opposite) return oppositeFault(station, *model.tool, teeth, parameters.flute_tolerance);
  return {};
}

}  // namespace

HammerSequence::HammerSequence(const HammerParameters& parameters, const MachineModel& model)
    : parameters_(parameters), model_(model), axes_(model) {
  const HammerStation& station = model_.needHammer("measure the tool tip");
  control_ = std::make_unique<StationControl>(parameters_, axes_, station.range_volt);
  model.needTool("find a flute");
  if (axes_.isTurned() && (station.position.count("x") == 0 || station.position.count("y") == 0)) {
    throw Error(model.file +
                ": frames.hammer is turned, expected hammer.position_mm of x and y: the receptance along an "
                "axis of the machine follows from both");
  }
  if (axes_.isTurned() && parameters_.cross_frf == 0) {
    throw Error(
        "cross_frf 0: frames.hammer of " + model.file +
        " is turned, expected 1: the receptance along an axis of the machine follows from the cross FRF");
  }
  parameters_.validate();
}

HammerSequence::~HammerSequence() = default;

void HammerSequence::reset() {
  phase_ = Phase::idle;
  control_ = std::make_unique<StationControl>(parameters_, axes_, model_.hammer->range_volt);
  steps_.reset();
  measurement_.reset();
  first_part_.reset();
  result_.reset();
}

std::vector<Command> HammerSequence::takeCommands() {
  return control_->takeCommands();
}
std::optional<Feedback> HammerSequence::takeFeedback() {
  std::optional<Feedback> feedback =
      measurement_ ? std::exchange(measurement_->feedback, std::nullopt) : std::nullopt;
  if (feedback && axes_.isTurned())
    feedback->progress = 0.5 * (feedback->progress + (first_part_ ? 1.0 : 0.0));
  return feedback;
}
std::optional<MeasureFrfResult> HammerSequence::takeResult() {
  return std::exchange(result_, std::nullopt);
}

// -------------------------------------------------------------------------------------------- inputs

bool HammerSequence::handle(const MeasureFrfGoal& goal) {
  if (isActive()) return false;
  steps_.reset();
  if (const std::string fault = goalFault(goal, parameters_, model_); !fault.empty()) {
    result_.emplace();
    result_->code = FrfCode::bad_goal;
    result_->message = fault;
    return true;
  }
  first_part_.reset();
  asked_modes_ = goal.modes;
  MeasureFrfGoal part = goal;
  if (axes_.isTurned()) part.modes = 0;  // along its axes other modes are seen
  begin(part);
  return true;
}

void HammerSequence::begin(const MeasureFrfGoal& goal) {
  measurement_ = std::make_unique<Measurement>(parameters_, model_, goal);
  steps_ = std::make_unique<StepRunner>(*measurement_, *control_);
  phase_ = Phase::steps;
  apply(goal.stamp, steps_->begin(goal.stamp));
}

void HammerSequence::handle(const CncState& state) {
  dispatch(state.stamp, control_->handle(state));
  checkDeadline(state.stamp);
}

void HammerSequence::handle(const SpindleAngle& angle) {
  dispatch(angle.stamp, control_->handle(angle));
  checkDeadline(angle.stamp);
}

void HammerSequence::handle(const SampleBlock& block) {
  if (!isActive()) return;
  std::size_t force = 0, gap = 0;
  try {
    force = block.channel("hammer");
    gap = block.channel("gap");
  } catch (const Error& error) {
    return abort(block.stamp, FrfCode::bad_data, error.what());
  }
  const auto found = std::find(block.channels.begin(), block.channels.end(), "gap_cross");
  const bool has_cross = parameters_.cross_frf != 0 && found != block.channels.end();
  const auto cross = static_cast<std::size_t>(found - block.channels.begin());
  for (std::size_t i = 0; i < block.size() && isActive(); ++i) {
    const double time = block.timeOf(i);
    if (time < measurement_->goal.stamp - SAME_TIME) continue;
    StationSample sample{
        time, block.first_index + i, block.sample_rate, block.at(i, force), block.at(i, gap), std::nullopt};
    if (has_cross) sample.cross_volt = block.at(i, cross);
    dispatch(time, control_->handle(sample));
  }
  if (block.size() > 0) checkDeadline(block.timeOf(block.size() - 1));
}

void HammerSequence::checkDeadline(double now) {
  if (isActive()) dispatch(now, control_->checkDeadline(now));
}

void HammerSequence::dispatch(double now, ControlEvent event) {
  if (!isActive()) return;
  if (const auto* fault = std::get_if<ControlFault>(&event)) return abort(now, fault->code, fault->text);
  if (phase_ == Phase::stopping && std::holds_alternative<MotionDone>(event)) return retract(now);
  if (phase_ == Phase::retracting && std::holds_alternative<MotionDone>(event)) return endPart(now);
  if (phase_ == Phase::steps) apply(now, steps_->handle(now, std::move(event)));
}

// --------------------------------------------------------------------------------------------- steps

void HammerSequence::apply(double now, const StepOutcome& outcome) {
  if (outcome.kind == StepOutcome::Kind::hits_completed) completeHits(now);
  if (outcome.kind == StepOutcome::Kind::failed) abort(now, outcome.code, outcome.reason);
}

/// Without a second height the hits of the first are evaluated alone.
void HammerSequence::completeHits(double now) {
  if (!measurement_->no_second_height.empty()) {
    measurement_->second.hits.clear();
    measurement_->report("no second height: " + measurement_->no_second_height, 0.95);
  }
  FrfEvaluation(*measurement_).evaluate();
  retract(now);
}

// ----------------------------------------------------------------------------------------------- end

void HammerSequence::cancel(double stamp) {
  if (phase_ == Phase::steps) abort(stamp, FrfCode::cancelled, "cancelled");
}

void HammerSequence::commandFailed(double stamp, const std::string& text) {
  if (!isActive()) return;
  abort(stamp, control_->isWaitingForHit() ? FrfCode::no_hit : FrfCode::motion_failed, text);
}

void HammerSequence::inputLost(double stamp, const std::string& text) {
  if (!isActive()) return;
  MeasureFrfResult& result = measurement_->result;
  if (phase_ == Phase::steps) {
    abort(stamp, FrfCode::bad_data, text);
    if (!isActive()) return;
    retract(stamp);
    result.message += "; a retract was commanded, its completion is not observed";
  } else {
    if (result.code == FrfCode::ok) result.code = FrfCode::bad_data;
    result.message += "; " + text + " during the retract";
  }
  finish();
}

void HammerSequence::abort(double now, FrfCode code, const std::string& reason) {
  if (!isActive()) return;
  MeasureFrfResult& result = measurement_->result;
  if (phase_ != Phase::steps) {
    // What failed is the retract.
    if (result.code == FrfCode::ok) result.code = code;
    result.message += "; not retracted: " + reason;
    return finish();
  }
  result.code = code;
  result.message = reason;
  control_->release();
  control_->watchRange(false);
  if (control_->hasCommanded()) control_->stop(now);
  if (!measurement_->at_station) return finish();
  if (!motionFault(*control_->state()).empty()) {
    result.message += "; the tool remains at the station, retract it by hand";
    return finish();
  }
  phase_ = Phase::stopping;
  measurement_->report("stopping: " + reason, 0.95);
}

void HammerSequence::retract(double now) {
  phase_ = Phase::retracting;
  control_->watchRange(false);
  measurement_->report("retracting from the station", 0.97);
  const auto here = control_->position();
  const Axes3 position = here ? here->position : Axes3{};
  control_->move(now, position, measurement_->paths.retract(position));
}

/// The receptance along an axis of the machine needs the hits along both axes of a turned station.
void HammerSequence::endPart(double now) {
  MeasureFrfResult& result = measurement_->result;
  if (!axes_.isTurned() || result.code != FrfCode::ok) return finish();
  if (result.cross.frf.size() == 0) {
    result.code = FrfCode::bad_data;
    result.message += "; a turned station requires the cross FRF";
    return finish();
  }
  if (!first_part_) {
    first_part_ = std::move(result);
    first_part_->spindle_moves = control_->spindleMoves();
    MeasureFrfGoal other = measurement_->goal;
    other.stamp = now;
    other.direction = AXIS_NAMES[measurement_->paths.across()];
    return begin(other);
  }
  result = alongMachineAxis(*first_part_, result, axes_.angle(), asked_modes_, parameters_);
  finish();
}

void HammerSequence::finish() {
  phase_ = Phase::idle;
  control_->release();
  measurement_->result.spindle_moves += control_->spindleMoves();
  result_ = std::move(measurement_->result);
}

}  // namespace smartmill::hammer
