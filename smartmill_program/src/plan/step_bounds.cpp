#include "smartmill_program/plan/step_bounds.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_program/prediction/force_predictor.h"

namespace smartmill::program {
namespace {

/// Feeds per tooth at which a limit is held.
struct Interval {
  double low = 0.0, high = FeedLimits::UNLIMITED;  // [m]

  void intersect(double from, double to) {
    low = std::max(low, from);
    high = std::min(high, to);
  }
  void clear() { high = -1.0; }
  bool empty() const { return !(high > 0.0) || high < low; }
};

[[noreturn]] void refuse(const Step& step, const char* what, double edges, double limit, const char* unit) {
  throw Error(formatted("%s: the %s of the edges alone is %.4g %s at any feed, the limit is %.4g %s",
                        step.move->operation.c_str(), what, edges, unit, limit, unit));
}

/// |edges + c chip| <= limit
void intersectForce(const ForceOverFeed& force, double limit, Interval& feeds) {
  const auto [edges, chip] = force;
  const double a = chip.fx * chip.fx + chip.fy * chip.fy, b = chip.fx * edges.fx + chip.fy * edges.fy,
               c = edges.fx * edges.fx + edges.fy * edges.fy - limit * limit;
  const double discriminant = b * b - a * c;
  if (a == 0.0) {
    if (c > 0.0) feeds.clear();
  } else if (discriminant < 0.0) {
    feeds.clear();
  } else {
    feeds.intersect((-b - std::sqrt(discriminant)) / a, (-b + std::sqrt(discriminant)) / a);
  }
}

/// edges + c chip <= limit
void intersectTorque(const ForceOverFeed& force, double limit, Interval& feeds) {
  const double edges = force.edges.torque, chip = force.chip.torque;
  if (chip > 0.0) {
    feeds.intersect(0.0, (limit - edges) / chip);
  } else if (edges > limit) {
    feeds.clear();
  }
}

}  // namespace

FeedBound StepBounds::of(const Move& move) const {
  FeedBound bound;
  bound.lower(limits_.machine, FeedLimit::machine);
  const nc::PathSegment& path = move.path;
  if (path.isArc() && path.sweep() != 0.0) {
    const double in_plane = path.radius() * std::abs(path.sweep()) / path.length();
    bound.lower(std::sqrt(limits_.acceleration * path.radius()) / in_plane, FeedLimit::acceleration);
  }
  return bound;
}

/// A feed per revolution follows the speed by itself.
double StepBounds::originalFeed(const Move& move) const {
  const auto ratio = speed_ratios_.find(move.speed_line);
  const bool follows = move.feed_word.mode == FeedMode::per_revolution;
  return ratio == speed_ratios_.end() || follows ? move.feed : move.feed * ratio->second;
}

FeedBound StepBounds::of(const Step& step) const {
  FeedBound bound;
  if (step.air()) return bound;
  const Move& move = *step.move;
  const MachineModel& model = models_.of(move.tool);
  const double tooth_rate = model.tool->teeth * move.spindle_speed / units::TWO_PI;  // [1/s]
  bound.lower(limits_.feed_per_tooth * tooth_rate, FeedLimit::feed_per_tooth);
  if (step.face_volume > 0.0 || step.contact.empty()) bound.lower(originalFeed(move), FeedLimit::no_model);
  if (!step.contact.empty()) {
    const double rate = tooth_rate / step.feed_share;  // [1/s] feed over horizontal feed per tooth
    bound.lower(limits_.chip / largestChip(*model.tool, step.contact, 1.0) * rate, FeedLimit::chip);
    boundForces(step, model, rate, bound);
  }
  return bound;
}

void StepBounds::boundForces(const Step& step, const MachineModel& model, double rate,
                             FeedBound& bound) const {
  const bool limited =
      std::isfinite(limits_.force) || std::isfinite(limits_.torque) || std::isfinite(limits_.power);
  if (!limited) return;
  const ForcePredictor predictor(*model.tool, model.needCutting("plan feeds"));
  ForceOverFeed mean;
  Interval by_force, by_torque, by_power;
  double edge_force = 0.0, edge_torque = 0.0;
  for (const ForceOverFeed& force : predictor.overFeed(step.contact, &mean)) {
    if (std::isfinite(limits_.force)) intersectForce(force, limits_.force, by_force);
    intersectTorque(force, limits_.torque, by_torque);
    edge_force = std::max(edge_force, std::hypot(force.edges.fx, force.edges.fy));
    edge_torque = std::max(edge_torque, force.edges.torque);
  }
  const double speed = step.move->spindle_speed;
  intersectTorque(mean, limits_.power / speed, by_power);
  if (by_force.empty()) refuse(step, "force", edge_force, limits_.force, "N");
  if (by_torque.empty()) refuse(step, "torque", edge_torque, limits_.torque, "N m");
  if (by_power.empty()) refuse(step, "power", mean.edges.torque * speed, limits_.power, "W");
  bound.lower(by_force.high * rate, FeedLimit::force);
  bound.lower(by_torque.high * rate, FeedLimit::torque);
  bound.lower(by_power.high * rate, FeedLimit::power);
}

}  // namespace smartmill::program
