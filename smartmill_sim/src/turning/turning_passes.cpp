#include "smartmill_sim/turning/turning_passes.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr double RAPID = 0.05, ACCELERATION = 1.0;  // [m/s], [m/s2]
constexpr double CLEARANCE = 2.0e-3;  // [m] from the workpiece in air: above the steady path's tolerance
constexpr double LEAD = 0.5;          // [s] of feed before the tool enters the workpiece

}  // namespace

void PassTraits::declare(ParameterTable& table) {
  table.number("radius", radius, "m", Range::openLow(0.0, 1.0), "of the workpiece at the start of each pass");
  table.number("reference_depth", reference_depth, "m", Range::openLow(0.0, 0.1),
               "depth of cut to which cutting_stiffness belongs");
  table.list("angle", angle, "rad", Range::closed(0.0, 1.5708),
             "direction of the feed of each pass: 0 longitudinal, pi/2 facing towards the axis");
  table.list("feed", feed, "m", Range::openLow(0.0, 0.01), "per revolution, of each pass");
  table.list("depth", depth, "m", Range::openLow(0.0, 0.1), "depth of cut of each pass");
  table.number("duration", duration, "s", Range::closed(1.0, 600.0), "of each pass, in air and in the cut");
}

void PassTraits::validate() const {
  checkBounds(*this);
  if (angle.empty() || feed.size() != angle.size() || depth.size() != angle.size())
    throw Error("pass_angle, pass_feed, pass_depth: " + std::to_string(angle.size()) + ", " +
                std::to_string(feed.size()) + ", " + std::to_string(depth.size()) +
                " values, expected one of each per pass");
}

std::array<double, 3> feedDirection(double angle) {
  return {-std::sin(angle), 0.0, -std::cos(angle)};
}

std::array<double, 3> clearDirection(double angle) {
  // From pi/2 on the face is the work, up to the rounding of a parameter.
  if (std::cos(angle) < 1e-4) return {0.0, 0.0, 1.0};
  return {std::cos(angle), 0.0, -std::sin(angle)};
}

TurningPasses::TurningPasses(const PassTraits& traits, double spindle_speed)
    : traits_((traits.validate(), traits)), spindle_speed_(spindle_speed), move_(Point{}) {
  for (std::size_t i = 0; i < traits.angle.size(); ++i) {
    const double way =
        traits.feed[i] * spindle_speed / units::TWO_PI * traits.duration * std::sin(traits.angle[i]);
    if (way + traits.depth[i] >= traits.radius)
      throw Error("pass_duration: pass " + std::to_string(i + 1) + " goes " + std::to_string(way) +
                  " m towards the axis, expected less than pass_radius");
  }
  move_ = PathMove(along(start(true), clearDirection(angle()), CLEARANCE));
  begin(0.0);
}

double TurningPasses::radiusAt(double x) const {
  return x + 0.5 * traits_.depth[pass_] * clearDirection(angle())[0];
}

double TurningPasses::velocity() const {
  return feed() * spindle_speed_ / units::TWO_PI;
}

TurningPasses::Point TurningPasses::along(const Point& from, const std::array<double, 3>& direction,
                                          double distance) const {
  Point point = from;
  for (std::size_t a = 0; a < 3; ++a) point[a] += distance * direction[a];
  return point;
}

// Where the feed begins: before the workpiece, whose corner is at pass_radius, z = 0.
TurningPasses::Point TurningPasses::start(bool air) const {
  const Point corner = along({traits_.radius, 0.0, 0.0}, clearDirection(angle()), -traits_.depth[pass_]);
  const Point before = along(corner, feedDirection(angle()), -LEAD * velocity());
  return air ? along(before, clearDirection(angle()), CLEARANCE) : before;
}

void TurningPasses::begin(double time) {
  const Point now = move_.position(time);
  if (step_ == Step::feed) {
    move_ = PathMove::line(now, along(now, feedDirection(angle()), velocity() * (LEAD + traits_.duration)));
    move_.plan(time, velocity(), ACCELERATION);
    announce(time, air_ ? CuttingCondition::Kind::air : CuttingCondition::Kind::cut);
    return;
  }
  move_ = PathMove::line(
      now, step_ == Step::retract ? along(now, clearDirection(angle()), CLEARANCE) : start(air_));
  move_.plan(time, RAPID, ACCELERATION);
  if (condition_.kind != CuttingCondition::Kind::none || passes_ == 0)
    announce(time, CuttingCondition::Kind::none);
}

void TurningPasses::announce(double time, CuttingCondition::Kind kind) {
  condition_ = CuttingCondition();
  condition_.stamp = time;
  condition_.kind = kind;
  condition_.name = "none_" + std::to_string(passes_);
  if (kind == CuttingCondition::Kind::none) return;
  ++passes_;
  condition_.name = (air_ ? "air_" : "turn_") + std::to_string(passes_);
  condition_.material = "steel";
  condition_.tool_name = "turning tool";
  condition_.spindle_speed = spindle_speed_;
  const Point from = along(move_.position(time), feedDirection(angle()), LEAD * velocity());
  condition_.steady_from = from;
  condition_.steady_to = move_.target();
  condition_.tool.diameter = 2.0 * radiusAt(0.5 * (from[0] + move_.target()[0]));
  condition_.engagement.axial_depth = traits_.depth[pass_];
  condition_.engagement.feed_per_tooth = feed();
}

bool TurningPasses::advance(double time) {
  const double before = condition_.stamp;
  const std::string name = condition_.name;
  while (time >= move_.end()) {
    const double end = move_.end();
    if (step_ == Step::approach) {
      step_ = Step::feed;
    } else if (step_ == Step::feed) {
      step_ = Step::retract;
    } else {
      step_ = Step::approach;
      if (!air_) pass_ = (pass_ + 1) % traits_.angle.size();
      air_ = !air_;
    }
    begin(end);
  }
  return condition_.stamp != before || condition_.name != name;
}

MotionState TurningPasses::state(double time) const {
  MotionState state;
  state.position = move_.position(time);
  state.velocity = move_.velocity(time);
  state.spindle_speed = spindle_speed_;
  state.spindle_angle = std::fmod(spindle_speed_ * time, units::TWO_PI);
  return state;
}

std::array<double, 3> TurningPasses::distanceToGo(double time) const {
  const Point now = move_.position(time);
  std::array<double, 3> to_go{};
  for (std::size_t a = 0; a < 3; ++a) to_go[a] = move_.target()[a] - now[a];
  return to_go;
}

bool TurningPasses::isCutting(double time) const {
  if (step_ != Step::feed || air_) return false;
  const Point now = move_.position(time);
  double way = 0.0;
  for (std::size_t a = 0; a < 3; ++a) way += (now[a] - condition_.steady_from[a]) * feedDirection(angle())[a];
  return way >= 0.0;
}

}  // namespace smartmill::sim
