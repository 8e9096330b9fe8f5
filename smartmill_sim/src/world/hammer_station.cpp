#include "smartmill_sim/world/hammer_station.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

// Limits of a position in front of a sensor: lateral, vertical and axial distance.
constexpr double BESIDE = 2e-3;    // [m]
constexpr double ABOVE = 30e-3;    // [m]
constexpr double FAR = 4e-3;       // [m]
constexpr double STANDING = 0.02;  // [rad/s] a hammer hits only a tool at rest
constexpr double RINGS = 2.0;      // [s] decay time of the vibration after a hit
constexpr int LOOK = 32;           // samples between two updates of a moving surface
constexpr std::array<const char*, 2> AXIS{{"x", "y"}};

/// Angle [rad] of a tooth that points along the axis.
double angleOf(std::size_t axis) {
  return axis == 0 ? 0.5 * units::PI : 0.0;
}

void checkHeight(double stickout, double struck) {
  if (struck < stickout) return;
  throw Error("hammer.offset_mm: " + std::to_string(struck / units::MM) +
              " mm above the tip, expected less than the tool's stickout");
}

bool same(const HammerStation::Place& a, const HammerStation::Place& b) {
  return a.angle == b.angle && a.position == b.position;
}

}  // namespace

HammerStation::HammerStation(const MachineModel& model, const StationTraits& traits, double force_scatter,
                             double step)
    : station_(model.needHammer("simulate its station")),
      tool_(model.needTool("simulate the hammer station")),
      traits_(traits),
      surface_(traits, tool_, station_.flute_depth),
      sensor_{{GapSensor(traits, station_, angleOf(0)), GapSensor(traits, station_, angleOf(1))}},
      solenoid_(traits, station_, force_scatter),
      step_(step) {
  turns_ = model.stickout.has_value();
  height_ = traits.read_height;
  if (turns_) checkHeight(*model.stickout, station_.offset);
  if (traits.structure != "beam") return;
  if (!model.stickout) throw Error("hammer_structure: beam needs the model's tool.stickout_mm");
  checkHeight(*model.stickout, station_.offset + traits.read_height);
  structure_.emplace(traits, tool_, *model.stickout);
  ways_.resize(2);
  for (std::size_t axis = 0; axis < 2; ++axis) standBy(axis);
}

/// Displacement at a height [m] of a rigid tool over that of its tip; the same ratio applies to forces.
double HammerStation::rigid(double height) const {
  return turns_ ? 1.0 - height / traits_.pivot : 1.0;
}

/// Updates the beam's filters for the height of the tool.
void HammerStation::standBy(std::size_t axis) {
  if (!structure_ || (!ways_[axis].tip.empty() && std::abs(height_ - way_height_[axis]) < 1e-7)) return;
  way_height_[axis] = height_;
  const auto filter = [&](std::size_t read_axis, double read) {
    return ModalFilter(structure_->between(read_axis, read, axis, height_ + station_.offset), 1.0 / step_,
                       Hold::first_order);
  };
  ways_[axis] = {{filter(0, height_), filter(1, height_)}, {filter(0, 0.0), filter(1, 0.0)}};
}

std::optional<ToolTip> HammerStation::tip() const {
  if (!structure_) return std::nullopt;
  return structure_->tip();
}

ModalModel HammerStation::measured(std::size_t read_axis, std::size_t struck_axis) const {
  return structure_->between(read_axis, traits_.read_height, struck_axis,
                             traits_.read_height + station_.offset);
}

std::optional<std::size_t> HammerStation::facing(const std::array<double, 3>& position) const {
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto found = station_.position.find(AXIS[axis]);
    if (found == station_.position.end()) continue;
    const Axes3& p = found->second;
    if (std::abs(position[1 - axis] - p[1 - axis]) < BESIDE && std::abs(position[2] - p[2]) < ABOVE &&
        std::abs(p[axis] - position[axis]) < FAR) {
      return axis;
    }
  }
  return std::nullopt;
}

void HammerStation::fire(std::size_t axis, double now, double touch, std::mt19937_64& random) {
  fired_ = true;
  fired_axis_ = axis;
  standBy(axis);
  solenoid_.fire(now, touch, random);
}

double HammerStation::struckRetreat(const Place& place, std::size_t axis) const {
  const double height = station_.position.at(AXIS[axis])[2] - place.position[2];
  return surface_.retreat(place.angle, height + traits_.read_height + station_.offset, angleOf(axis));
}

/// Draws the positioning error of an axis that has stopped.
void HammerStation::settle(const Place& place, std::mt19937_64& random) {
  if (place.position != place_.position) {
    moving_ = true;
  } else if (moving_) {
    moving_ = false;
    std::normal_distribution<double> normal;
    for (std::size_t axis = 0; axis < 2 && traits_.axis_scatter > 0.0; ++axis) {
      if (place.position[axis] != stopped_[axis]) unseen_[axis] = traits_.axis_scatter * normal(random);
    }
    stopped_ = place.position;
  }
}

void HammerStation::stand(const Place& place, std::mt19937_64& random) {
  settle(place, random);
  place_ = place;
  steps_ = 0;
  force_sum_ = 0.0;
  volt_sum_ = {{0, 0}};
  touched_ = false;
  const std::optional<std::size_t> before = facing(place.position);
  if (before != before_) {
    before_ = before;
    faced_.reset();
    rings_until_ = -1.0;
    now_ = {{0, 0}};
    for (Way& way : ways_) {
      for (ModalFilter& f : way.read) f.reset();
      for (ModalFilter& f : way.tip) f.reset();
    }
    if (before) closest_ = 1.0;
  }
  if (!before_) return;
  height_ = station_.position.at(AXIS[*before_])[2] - place.position[2] + traits_.read_height;
  const bool stale = !faced_ || !same(*faced_, place);
  const bool at_rest = !moving_ && place.speed == 0.0;
  if (stale && (at_rest || !faced_ || ++since_faced_ >= LOOK)) {
    since_faced_ = 0;
    faced_ = place;
    const Axes3& p = station_.position.at(AXIS[*before_]);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (axis != *before_ && !traits_.cross_sensor) continue;
      const double off = place.position[1 - axis] - p[1 - axis] + traits_.beside;
      sensor_[axis].face(surface_, place.angle, height_, off);
      seen_[axis] = Seen();
    }
  }
}

HammerStation::Push HammerStation::push(double time) {
  Push push;
  const bool meets = fired_ && before_ == fired_axis_ && place_.speed <= STANDING;
  if (meets) push.force = solenoid_.force(time);
  if (push.force != 0.0) rings_until_ = time + RINGS;
  if (structure_ && before_ && time < rings_until_) {
    // The hit comes from the sensor's side.
    Way& way = ways_[fired_axis_];
    for (std::size_t axis = 0; axis < 2; ++axis) {
      now_[axis] = way.read[axis].step(-push.force);
      push.tip[axis] = way.tip[axis].step(-push.force);
    }
  } else if (meets) {
    push.tip_force[fired_axis_] = -rigid(height_ + station_.offset) * push.force;
  }
  ++steps_;
  force_sum_ += push.force;
  return push;
}

/// Distance [m] from each sensor's face to the cutting circle.
std::array<double, 2> HammerStation::gaps(const std::array<double, 2>& displacement) const {
  const Axes3& p = station_.position.at(AXIS[*before_]);
  std::array<double, 2> gap{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    gap[axis] = p[axis] + 2.0 * station_.gap_at_zero_volt - place_.position[axis] - unseen_[axis] -
                displacement[axis];
  }
  return gap;
}

void HammerStation::hear(const std::array<double, 2>& displacement) {
  if (!before_) return;
  const double share = structure_ ? 1.0 : rigid(height_);
  const std::array<double, 2> gap =
      gaps({{share * displacement[0] + now_[0], share * displacement[1] + now_[1]}});
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (axis != *before_ && !traits_.cross_sensor) continue;
    Seen& seen = seen_[axis];
    if (gap[axis] != seen.gap) {
      seen.gap = gap[axis];
      seen.clearance = sensor_[axis].clearance(gap[axis]);
      seen.volt = seen.clearance > 0.0 ? sensor_[axis].voltage(gap[axis]) : station_.range_volt;
    }
    closest_ = std::min(closest_, seen.clearance);
    if (seen.clearance <= 0.0 && traits_.housing > 0.0) touched_ = true;
    volt_sum_[axis] += seen.volt;
  }
}

HammerStation::Reading HammerStation::read(double time, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double current = fired_ ? solenoid_.current(time) : 0.0;
  Reading reading;
  reading.force = force_sum_ / std::max(1, steps_) + traits_.coil_force * current +
                  station_.force_noise_rms * normal(random);
  const auto volt = [&](std::size_t axis) {
    const double mean = before_ ? volt_sum_[axis] / std::max(1, steps_) : -station_.range_volt;
    return sensor_[axis].clipped(mean + traits_.coil_volt * current +
                                 station_.voltage_noise_rms * normal(random));
  };
  const std::size_t axis = before_.value_or(0);
  reading.gap = volt(axis);
  if (traits_.cross_sensor) reading.cross = volt(1 - axis);
  return reading;
}

}  // namespace smartmill::sim
