#include "smartmill_program/tool/tool_monitor.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/names.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

constexpr double ANGLE_JUMP = 0.3;  // [rad] of the advance against the speed

}  // namespace

ToolMonitor::ToolMonitor(const ToolMonitorParameters& parameters, SharpTools tools, double hold_back,
                         Output output)
    : parameters_(parameters),
      tools_(std::move(tools)),
      watch_(parameters.watch),
      wear_(parameters.wear),
      output_(std::move(output)),
      sorter_(hold_back),
      conditions_(sorter_.addLatched(names::CUTTING_CONDITION)),
      states_(sorter_.addOptional(names::CNC_STATE)),
      angles_(sorter_.addRegular(names::SPINDLE_ANGLE)),
      blocks_(sorter_.addRegular(names::FORCE_COMPENSATED)),
      tool_(tools_.first()) {
  parameters_.validate();
  watch_.setTool(tool_);
  sorter_.onRestart([this] { restart(); });
}

void ToolMonitor::push(const CuttingCondition& condition) {
  sorter_.push(conditions_, condition.stamp, [this, condition] { handle(condition); });
}

void ToolMonitor::push(const CncState& state) {
  sorter_.push(states_, state.stamp, [this, state] { handle(state); });
}

void ToolMonitor::push(const SpindleAngle& angle) {
  sorter_.push(angles_, angle.stamp, [this, angle] { handle(angle); });
}

void ToolMonitor::push(const ForceBlock& block) {
  sorter_.push(blocks_, block.stamp, [this, block] { handle(block); });
}

void ToolMonitor::push(const SampleBlock& block) {
  ForceBlock force;
  force.stamp = block.stamp;
  force.sample_rate = block.sample_rate;
  force.first_index = block.first_index;
  force.force[0] = block.column("fx");
  force.force[1] = block.column("fy");
  push(force);
}

void ToolMonitor::newTool(double stamp) {
  gap();
  loss_.reset();
  wear_.forget();
  report(stamp, false, {});
}

void ToolMonitor::restart() {
  gap();
  angle_.reset();
  condition_ = {};
  loss_.reset();
  losses_.clear();
  wear_.begin(condition_, std::nullopt);
  next_index_ = 0;
  steady_since_.reset();
  reported_ = -std::numeric_limits<double>::infinity();
}

void ToolMonitor::gap() {
  samples_.clear();
  watch_.reset();
}

void ToolMonitor::handle(const CuttingCondition& condition) {
  if (const std::optional<CutWear> wear = wear_.end()) report(wear->stamp, false, wear);
  const bool stated = condition.kind != CuttingCondition::Kind::none;
  if (stated && condition.tool.teeth > 0) {
    if (condition.tool_name != condition_.tool_name) changeTool(condition.tool_name);
    tool_ = condition.tool;
    watch_.setTool(tool_, condition.engagement.axial_depth);
  }
  const std::string last_tool = condition_.tool_name;
  condition_ = condition;
  if (!stated) condition_.tool_name = last_tool;
  steady_since_.reset();
  wear_.begin(condition, tools_.of(condition));
}

void ToolMonitor::changeTool(const std::string& name) {
  if (loss_) losses_[condition_.tool_name] = *loss_;
  const auto lost = losses_.find(name);
  loss_ = lost == losses_.end() ? std::nullopt : std::optional<ToothLoss>(lost->second);
  losses_.erase(name);
  gap();  // the forces of another tool are no reference
}

void ToolMonitor::handle(const CncState& state) {
  const double teeth_per_second = tool_.teeth * state.spindle_speed / units::TWO_PI;
  watch_.setFeed(state.connected && teeth_per_second > 0.0 ? std::optional(state.feed / teeth_per_second)
                                                           : std::nullopt);
  const bool steady = condition_.kind == CuttingCondition::Kind::cut && state.connected && state.feed > 0.0 &&
                      onSteadyPath(condition_, state, parameters_.path_tolerance);
  if (!steady || (steady_since_ && state.stamp - steady_ > parameters_.maximum_gap)) steady_since_.reset();
  if (!steady) return;
  if (!steady_since_) steady_since_ = state.stamp;
  steady_ = state.stamp;
}

void ToolMonitor::handle(const ForceBlock& block) {
  // The loss of a tooth is a transient itself.
  const ForceBlock::Status kind = block.isCompensated() ? ForceBlock::Status::compensated : block.status;
  if (block.first_index != next_index_ || kind != status_) gap();
  next_index_ = block.first_index + block.force[0].size();
  status_ = kind;
  if (block.isUnusable()) return;
  for (std::size_t i = 0; i < block.force[0].size(); ++i) {
    const Sample sample{block.stamp + static_cast<double>(i) / block.sample_rate, block.force[0][i],
                        block.force[1][i]};
    if (std::isfinite(sample.fx + sample.fy)) {
      samples_.push_back(sample);
    } else {
      gap();
    }
  }
}

void ToolMonitor::handle(const SpindleAngle& angle) {
  if (!std::isfinite(angle.angle) || !std::isfinite(angle.speed) || !(angle.speed > 0.0)) {
    angle_.reset();
    gap();
    return;
  }
  if (!angle_) {
    while (!samples_.empty() && samples_.front().time < angle.stamp) samples_.pop_front();
    angle_ = UnwrappedAngle{angle.stamp, angle.angle, angle.angle};
    speed_ = angle.speed;
    return;
  }
  if (!(angle.stamp > angle_->time)) return;
  const double passed = angle.stamp - angle_->time;
  const UnwrappedAngle next = angle_->next(angle);
  const double expected = 0.5 * (speed_ + angle.speed) * passed;
  speed_ = angle.speed;
  if (passed > parameters_.maximum_gap || std::abs(next.turned - angle_->turned - expected) > ANGLE_JUMP) {
    angle_ = UnwrappedAngle{angle.stamp, angle.angle, angle.angle};
    gap();
    return;
  }
  while (!samples_.empty() && samples_.front().time <= angle.stamp) {
    const Sample& s = samples_.front();
    if (s.time >= angle_->time) take({s.time, angle_->between(next, s.time), s.fx, s.fy});
    samples_.pop_front();
  }
  angle_ = next;
}

void ToolMonitor::take(const ForceSample& sample) {
  if (const std::optional<ToothLoss> loss = watch_.push(sample)) {
    loss_ = loss;
    report(loss->stamp, true, wear_.present());
  }
  const std::optional<RevolutionForce> revolution = watch_.takeRevolution();
  if (loss_) return;  // the expected force is that of all teeth
  if (!revolution || !steady_since_ || revolution->begin < *steady_since_ ||
      revolution->time - steady_ > parameters_.maximum_gap)
    return;
  wear_.add(revolution->time, revolution->force);
  if (revolution->time - reported_ < parameters_.report_period) return;
  if (const std::optional<CutWear> wear = wear_.present()) {
    reported_ = revolution->time;
    report(revolution->time, false, wear);
  }
}

void ToolMonitor::report(double stamp, bool new_loss, const std::optional<CutWear>& wear) {
  ToolReport report;
  report.stamp = stamp;
  report.condition = condition_.name;
  report.tool = condition_.tool_name;
  report.teeth = tool_.teeth;
  report.new_loss = new_loss;
  report.loss = loss_;
  report.wear = wear;
  output_(report);
}

}  // namespace smartmill::program
