#include "smartmill_sim/world/hammer_station.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr std::array<const char*, 2> AXIS{{"x", "y"}};

/// Angle [rad] of a tooth that points along an axis of the station. @param turn [rad] of the station
double angleOf(std::size_t axis, double turn) {
  return (axis == 0 ? 0.5 * units::PI : 0.0) - turn;
}

/// The section with its positions along the axes of the station.
smartmill::HammerStation alongItsAxes(smartmill::HammerStation station, const StationAxes& axes) {
  for (auto& entry : station.position) entry.second = axes.toStation(entry.second);
  return station;
}

std::array<double, 2> inPlane(const Axes3& v) {
  return {v[0], v[1]};
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
    : axes_(model),
      station_(alongItsAxes(model.needHammer("simulate its station"), axes_)),
      tool_(model.needTool("simulate the hammer station")),
      traits_(traits),
      surface_(traits, tool_, station_.flute_depth),
      gap_{{GapMean(GapSensor(traits, station_, angleOf(0, axes_.angle())), station_.range_volt),
            GapMean(GapSensor(traits, station_, angleOf(1, axes_.angle())), station_.range_volt)}},
      solenoid_(traits, station_, force_scatter),
      error_(traits.axis_scatter) {
  pivots_ = model.stickout.has_value();
  height_ = traits.read_height;
  if (pivots_) checkHeight(*model.stickout, station_.offset);
  if (traits.structure != "beam") return;
  if (!model.stickout) throw Error("hammer_structure: beam needs the model's tool.stickout_mm");
  checkHeight(*model.stickout, station_.offset + traits.read_height);
  StationTraits along = traits;
  along.plane_turn -= axes_.angle();
  beam_.emplace(along, tool_, *model.stickout, station_.offset, step);
  tip_ = ToolStructure(traits, tool_, *model.stickout).tip();
}

/// Displacement at a height [m] of a rigid tool over that of its tip; the same ratio applies to forces.
double HammerStation::rigidRatio(double height) const {
  return pivots_ ? 1.0 - height / traits_.pivot : 1.0;
}

std::optional<ToolTip> HammerStation::tip() const {
  return tip_;
}

ModalModel HammerStation::measured(std::size_t read_axis, std::size_t struck_axis) const {
  return beam_->structure().between(read_axis, traits_.read_height, struck_axis,
                                    traits_.read_height + station_.offset);
}

std::optional<std::size_t> HammerStation::facing(const std::array<double, 3>& position) const {
  return facingAt(axes_.toStation(position));
}

std::optional<std::size_t> HammerStation::facingAt(const Axes3& position) const {
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto found = station_.position.find(AXIS[axis]);
    if (found == station_.position.end()) continue;
    const Axes3& p = found->second;
    if (std::abs(position[1 - axis] - p[1 - axis]) < traits_.lateral_reach &&
        std::abs(position[2] - p[2]) < traits_.vertical_reach &&
        std::abs(p[axis] - position[axis]) < traits_.axial_reach) {
      return axis;
    }
  }
  return std::nullopt;
}

void HammerStation::fire(std::size_t axis, double now, double touch, std::mt19937_64& random) {
  fired_ = true;
  fired_axis_ = axis;
  if (beam_) beam_->setHeight(axis, height_);
  solenoid_.fire(now, touch, random);
}

double HammerStation::struckRetreat(const Pose& pose, std::size_t axis) const {
  const double height = station_.position.at(AXIS[axis])[2] - pose.position[2];
  const double facing = angleOf(axis, axes_.angle()) + (station_.opposite ? units::PI : 0.0);
  return surface_.retreat(pose.angle, height + traits_.read_height + station_.offset, facing);
}

void HammerStation::PositionError::update(const Axes3& before, const Axes3& now, std::mt19937_64& random) {
  if (now != before) {
    moving_ = true;
  } else if (moving_) {
    moving_ = false;
    std::normal_distribution<double> normal;
    for (std::size_t axis = 0; axis < 2 && deviation_ > 0.0; ++axis) {
      if (now[axis] != stopped_[axis]) error_[axis] = deviation_ * normal(random);
    }
    stopped_ = now;
  }
}

void HammerStation::setPose(const Pose& machine_pose, std::mt19937_64& random) {
  const Pose pose{axes_.toStation(machine_pose.position), machine_pose.angle, machine_pose.speed};
  error_.update(pose_.position, pose.position, random);
  pose_ = pose;
  steps_ = 0;
  force_sum_ = 0.0;
  for (GapMean& gap : gap_) gap.clear();
  touched_ = false;
  const std::optional<std::size_t> facing_axis = facingAt(pose.position);
  if (facing_axis != facing_axis_) {
    facing_axis_ = facing_axis;
    surface_pose_.reset();
    if (beam_) beam_->reset();
    if (facing_axis) closest_ = 1.0;
  }
  if (facing_axis_) updateTarget();
}

/// Updates the surface in front of the sensors that the tool faces.
void HammerStation::updateTarget() {
  const Axes3& p = station_.position.at(AXIS[*facing_axis_]);
  height_ = p[2] - pose_.position[2] + traits_.read_height;
  const bool at_rest = !error_.moving() && pose_.speed == 0.0;
  if (surface_pose_ &&
      (isSamePose(*surface_pose_, pose_) || !(at_rest || ++samples_since_update_ >= traits_.surface_update)))
    return;
  samples_since_update_ = 0;
  surface_pose_ = pose_;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (!reads(axis)) continue;
    const double off = pose_.position[1 - axis] - p[1 - axis] + traits_.beside;
    gap_[axis].setTarget(surface_, pose_.angle, height_, off);
  }
}

HammerStation::Push HammerStation::push(double time) {
  Push push;
  const bool meets = fired_ && facing_axis_ == fired_axis_ && pose_.speed <= traits_.rest_speed;
  if (meets) push.force = solenoid_.force(time);
  const double along = station_.opposite ? push.force : -push.force;  // the sensor is on the positive side
  if (beam_ && beam_->vibrates(time, push.force) && facing_axis_) {
    const std::array<double, 2> tip = beam_->step(fired_axis_, along);
    push.tip = inPlane(axes_.toMachine({tip[0], tip[1], 0.0}));
  } else if (meets) {
    Axes3 force{};
    force[fired_axis_] = rigidRatio(height_ + station_.offset) * along;
    push.tip_force = inPlane(axes_.toMachine(force));
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
    gap[axis] = p[axis] + 2.0 * station_.gap_at_zero_volt - pose_.position[axis] - error_.at(axis) -
                displacement[axis];
  }
  return gap;
}

void HammerStation::addDisplacement(const std::array<double, 2>& in_machine) {
  if (!facing_axis_) return;
  const std::array<double, 2> displacement = inPlane(axes_.toStation({in_machine[0], in_machine[1], 0.0}));
  std::array<double, 2> at = displacement;
  for (std::size_t axis = 0; axis < 2; ++axis)
    at[axis] =
        beam_ ? displacement[axis] + beam_->atSensor()[axis] : rigidRatio(height_) * displacement[axis];
  const std::array<double, 2> gap = gaps(at);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (!reads(axis)) continue;
    const double clearance = gap_[axis].add(gap[axis]);
    closest_ = std::min(closest_, clearance);
    if (clearance <= 0.0 && traits_.housing > 0.0) touched_ = true;
  }
}

HammerStation::Sample HammerStation::read(double time, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double current = fired_ ? solenoid_.current(time) : 0.0;
  Sample sample;
  sample.force = force_sum_ / std::max(1, steps_) + traits_.coil_force * current +
                 station_.force_noise_rms * normal(random);
  const auto volt = [&](std::size_t axis) {
    const double mean = facing_axis_ ? gap_[axis].sum() / std::max(1, steps_) : -station_.range_volt;
    return gap_[axis].sensor().clipped(mean + traits_.coil_volt * current +
                                       station_.voltage_noise_rms * normal(random));
  };
  const std::size_t axis = facing_axis_.value_or(0);
  sample.gap = volt(axis);
  if (traits_.cross_sensor) sample.cross = volt(1 - axis);
  return sample;
}

}  // namespace smartmill::sim
