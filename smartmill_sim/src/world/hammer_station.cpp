#include "smartmill_sim/world/hammer_station.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

// Limits of a position in front of a sensor: lateral, vertical and axial distance.
constexpr double LATERAL = 2e-3;    // [m]
constexpr double VERTICAL = 30e-3;  // [m]
constexpr double AXIAL = 4e-3;      // [m]
constexpr double AT_REST = 0.02;    // [rad/s] a hammer hits only a tool at rest
constexpr double DECAY_TIME = 2.0;  // [s] decay time of the vibration after a hit
constexpr int SURFACE_UPDATE = 32;  // samples between two updates of a moving surface
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

bool isSamePose(const HammerStation::Pose& a, const HammerStation::Pose& b) {
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
  pivots_ = model.stickout.has_value();
  height_ = traits.read_height;
  if (pivots_) checkHeight(*model.stickout, station_.offset);
  if (traits.structure != "beam") return;
  if (!model.stickout) throw Error("hammer_structure: beam needs the model's tool.stickout_mm");
  checkHeight(*model.stickout, station_.offset + traits.read_height);
  structure_.emplace(traits, tool_, *model.stickout);
  paths_.resize(2);
  for (std::size_t axis = 0; axis < 2; ++axis) updateFilters(axis);
}

/// Displacement at a height [m] of a rigid tool over that of its tip; the same ratio applies to forces.
double HammerStation::rigidRatio(double height) const {
  return pivots_ ? 1.0 - height / traits_.pivot : 1.0;
}

/// Updates the beam's filters for the height of the tool.
void HammerStation::updateFilters(std::size_t axis) {
  if (!structure_ || (!paths_[axis].tip.empty() && std::abs(height_ - path_height_[axis]) < 1e-7)) return;
  path_height_[axis] = height_;
  const auto filter = [&](std::size_t read_axis, double read) {
    return ModalFilter(structure_->between(read_axis, read, axis, height_ + station_.offset), 1.0 / step_,
                       Hold::first_order);
  };
  paths_[axis] = {{filter(0, height_), filter(1, height_)}, {filter(0, 0.0), filter(1, 0.0)}};
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
    if (std::abs(position[1 - axis] - p[1 - axis]) < LATERAL && std::abs(position[2] - p[2]) < VERTICAL &&
        std::abs(p[axis] - position[axis]) < AXIAL) {
      return axis;
    }
  }
  return std::nullopt;
}

void HammerStation::fire(std::size_t axis, double now, double touch, std::mt19937_64& random) {
  fired_ = true;
  fired_axis_ = axis;
  updateFilters(axis);
  solenoid_.fire(now, touch, random);
}

double HammerStation::struckRetreat(const Pose& pose, std::size_t axis) const {
  const double height = station_.position.at(AXIS[axis])[2] - pose.position[2];
  return surface_.retreat(pose.angle, height + traits_.read_height + station_.offset, angleOf(axis));
}

/// Draws the positioning error of an axis that has stopped.
void HammerStation::updatePositionError(const Pose& pose, std::mt19937_64& random) {
  if (pose.position != pose_.position) {
    moving_ = true;
  } else if (moving_) {
    moving_ = false;
    std::normal_distribution<double> normal;
    for (std::size_t axis = 0; axis < 2 && traits_.axis_scatter > 0.0; ++axis) {
      if (pose.position[axis] != stopped_[axis])
        position_error_[axis] = traits_.axis_scatter * normal(random);
    }
    stopped_ = pose.position;
  }
}

void HammerStation::setPose(const Pose& pose, std::mt19937_64& random) {
  updatePositionError(pose, random);
  pose_ = pose;
  steps_ = 0;
  force_sum_ = 0.0;
  volt_sum_ = {{0, 0}};
  touched_ = false;
  const std::optional<std::size_t> facing_axis = facing(pose.position);
  if (facing_axis != facing_axis_) {
    facing_axis_ = facing_axis;
    surface_pose_.reset();
    vibrates_until_ = -1.0;
    sensor_displacement_ = {{0, 0}};
    for (ResponsePath& path : paths_) {
      for (ModalFilter& f : path.read) f.reset();
      for (ModalFilter& f : path.tip) f.reset();
    }
    if (facing_axis) closest_ = 1.0;
  }
  if (!facing_axis_) return;
  height_ = station_.position.at(AXIS[*facing_axis_])[2] - pose.position[2] + traits_.read_height;
  const bool stale = !surface_pose_ || !isSamePose(*surface_pose_, pose);
  const bool at_rest = !moving_ && pose.speed == 0.0;
  if (stale && (at_rest || !surface_pose_ || ++samples_since_update_ >= SURFACE_UPDATE)) {
    samples_since_update_ = 0;
    surface_pose_ = pose;
    const Axes3& p = station_.position.at(AXIS[*facing_axis_]);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (axis != *facing_axis_ && !traits_.cross_sensor) continue;
      const double off = pose.position[1 - axis] - p[1 - axis] + traits_.beside;
      sensor_[axis].setTarget(surface_, pose.angle, height_, off);
      gap_cache_[axis] = GapCache();
    }
  }
}

HammerStation::Push HammerStation::push(double time) {
  Push push;
  const bool meets = fired_ && facing_axis_ == fired_axis_ && pose_.speed <= AT_REST;
  if (meets) push.force = solenoid_.force(time);
  if (push.force != 0.0) vibrates_until_ = time + DECAY_TIME;
  if (structure_ && facing_axis_ && time < vibrates_until_) {
    // The hit comes from the sensor's side.
    ResponsePath& path = paths_[fired_axis_];
    for (std::size_t axis = 0; axis < 2; ++axis) {
      sensor_displacement_[axis] = path.read[axis].step(-push.force);
      push.tip[axis] = path.tip[axis].step(-push.force);
    }
  } else if (meets) {
    push.tip_force[fired_axis_] = -rigidRatio(height_ + station_.offset) * push.force;
  }
  ++steps_;
  force_sum_ += push.force;
  return push;
}

/// Distance [m] from each sensor's face to the cutting circle.
std::array<double, 2> HammerStation::gaps(const std::array<double, 2>& displacement) const {
  const Axes3& p = station_.position.at(AXIS[*facing_axis_]);
  std::array<double, 2> gap{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    gap[axis] = p[axis] + 2.0 * station_.gap_at_zero_volt - pose_.position[axis] - position_error_[axis] -
                displacement[axis];
  }
  return gap;
}

void HammerStation::addDisplacement(const std::array<double, 2>& displacement) {
  if (!facing_axis_) return;
  const double share = structure_ ? 1.0 : rigidRatio(height_);
  const std::array<double, 2> gap = gaps({{share * displacement[0] + sensor_displacement_[0],
                                           share * displacement[1] + sensor_displacement_[1]}});
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (axis != *facing_axis_ && !traits_.cross_sensor) continue;
    GapCache& cache = gap_cache_[axis];
    if (gap[axis] != cache.gap) {
      cache.gap = gap[axis];
      cache.clearance = sensor_[axis].clearance(gap[axis]);
      cache.volt = cache.clearance > 0.0 ? sensor_[axis].voltage(gap[axis]) : station_.range_volt;
    }
    closest_ = std::min(closest_, cache.clearance);
    if (cache.clearance <= 0.0 && traits_.housing > 0.0) touched_ = true;
    volt_sum_[axis] += cache.volt;
  }
}

HammerStation::Sample HammerStation::read(double time, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double current = fired_ ? solenoid_.current(time) : 0.0;
  Sample sample;
  sample.force = force_sum_ / std::max(1, steps_) + traits_.coil_force * current +
                 station_.force_noise_rms * normal(random);
  const auto volt = [&](std::size_t axis) {
    const double mean = facing_axis_ ? volt_sum_[axis] / std::max(1, steps_) : -station_.range_volt;
    return sensor_[axis].clipped(mean + traits_.coil_volt * current +
                                 station_.voltage_noise_rms * normal(random));
  };
  const std::size_t axis = facing_axis_.value_or(0);
  sample.gap = volt(axis);
  if (traits_.cross_sensor) sample.cross = volt(1 - axis);
  return sample;
}

}  // namespace smartmill::sim
