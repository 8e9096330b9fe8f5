#include "smartmill_sim/world/world.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <optional>
#include <random>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/controller/servo_recorder.h"
#include "smartmill_sim/twin/cutting_machine.h"
#include "smartmill_sim/world/hammer_station.h"
#include "smartmill_sim/world/stock.h"

namespace smartmill::sim {
namespace {

constexpr std::size_t CONTACT_UPDATE = 64;  // samples between two updates of the contact with the stock
constexpr double HAMMER_DELAY = 0.03;       // [s] of the solenoid
constexpr double TURNING = 1.0;             // [rad/s] a slower spindle cannot cut
constexpr double SAME_ANGLE = 1e-7;         // [rad]
constexpr std::uint64_t FLANGE_SEED = 0x1000, PLATE_SEED = 0x2000;  // offsets from the seed of the world
constexpr int TOUCHED = 3001, PLUNGED = 3002, SENSOR = 3003;        // external alarms

bool isSameContact(const std::vector<ContactArc>& a, const std::vector<ContactArc>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const ContactArc& p, const ContactArc& q) {
    return std::abs(p.entry - q.entry) < SAME_ANGLE && std::abs(p.exit - q.exit) < SAME_ANGLE &&
           p.depth == q.depth;
  });
}

/// The model with the tool structure of the hammer station, if it defines one.
MachineModel withStructure(MachineModel model, const std::optional<HammerStation>& station) {
  if (station) {
    if (const std::optional<ToolTip> tip = station->tip()) model.tool_tip = *tip;
  }
  return model;
}

std::optional<HammerStation> stationOf(const MachineModel& model, const WorldOptions& options) {
  if (!model.hammer || !model.tool) return std::nullopt;
  return HammerStation(model, options.hammer, options.force_scatter,
                       1.0 / (World::SAMPLE_RATE * options.substeps));
}

}  // namespace

void WorldOptions::validate() const {
  checkBounds(*this);
  hammer.validate();
  spindle_sensor.validate();
}

class World::Impl {
 public:
  Impl(const MachineModel& model, const WorldOptions& options)
      : options_(options),
        spindle_(model.needSpindle("simulate the machine")),
        controller_(controllerOptions(model, options)),
        servo_(options.servo_trigger, options.motor.drives()),
        station_(stationOf(model, options)),
        tip_(withStructure(model, station_).tool_tip),
        machine_(withStructure(model, station_), 1.0 / (SAMPLE_RATE * options.substeps)),
        random_(options.seed) {
    const ToolGeometry& tool = model.needTool("simulate the machine");
    model.needCutting("simulate the machine");
    model.needAxes("simulate the machine");
    if (!spindle_.load_meter_full_scale) {
      throw Error(model.file +
                  ": spindle.load_meter_full_scale_v is missing (needed to simulate the machine)");
    }
    if (model.workpiece) stock_.emplace(*model.workpiece, tool.radius());
    if (options.motor.currents) motors_.emplace(options.motor, spindle_, options.seed);
    if (model.force_sensor.noise_rms) force_noise_ = *model.force_sensor.noise_rms;
    last_ = controller_.motion();
    machine_.resetLoadMeter(0.0);
    const double step = 1.0 / (SAMPLE_RATE * options.substeps);
    if (options.spindle_sensor.present)
      flange_.emplace(options.spindle_sensor, step, SAMPLE_RATE, options.seed + FLANGE_SEED);
    if (options.plate.present) plate_.emplace(options.plate, step, options.seed + PLATE_SEED);
  }

  Controller& controller() { return controller_; }
  const ToolTip& toolTip() const { return tip_; }

  StrikeAnswer strike(const std::string& point, const std::string& direction, std::string& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::size_t axis = direction == "x" ? 0 : direction == "y" ? 1 : direction == "z" ? 2 : 3;
    const double now = static_cast<double>(index_) / SAMPLE_RATE;
    if ((workpiece_hit_ && !workpiece_hit_->over(now)) || (tool_hit_ && !tool_hit_->over(now)) ||
        (station_ && station_->busy(now))) {
      message = "the previous hit is still in progress";
      return StrikeAnswer::failed;
    }
    const bool tool = point == "tool";
    const bool before_hammer = station_ && axis < 2 && (!flange_ || station_->facing(last_.position) == axis);
    if (tool && before_hammer) {
      // At a random time between two samples.
      station_->fire(axis, now, now + HAMMER_DELAY + uniform() / SAMPLE_RATE, random_);
      message = "hammer fired in " + direction;
    } else if (tool && flange_ && axis < 3) {
      tool_hit_ = drawHit(now);
      tool_hit_axis_ = axis;
      message = "hammer fired on the tool's tip in " + direction;
    } else if (point == "force_sensor" && axis < 3) {
      workpiece_hit_ = drawHit(now);
      workpiece_hit_axis_ = axis;
      message = options_.operator_delay > 0.0 ? "hit the workpiece by hand in " + direction
                                              : "hammer fired on the workpiece in " + direction;
    } else {
      message = "no hammer for point '" + point + "', direction '" + direction + "'";
      return StrikeAnswer::failed;
    }
    return tool || options_.operator_delay == 0.0 ? StrikeAnswer::ok : StrikeAnswer::by_hand;
  }

  void advance(Block& block) {
    const std::lock_guard<std::mutex> lock(mutex_);
    controller_.advance(1.0 / SAMPLE_RATE, BLOCK, states_);
    simulateBlock(block, states_);
    controller_.setSpindleLoad(100.0 * load_meter_ / *spindle_.load_meter_full_scale);
    controller_.setSpindleTorque(torque_ / BLOCK);
    controller_.setServoCurrent(servo_.current());
    controller_.setServoLoad(servo_.load());
  }

  void advance(Block& block, const std::vector<MotionState>& states) {
    const std::lock_guard<std::mutex> lock(mutex_);
    simulateBlock(block, states);
  }

  void pull(const std::array<double, 3>& force, bool on_table) {
    const std::lock_guard<std::mutex> lock(mutex_);
    pull_ = force;
    pull_on_table_ = on_table;
  }

  void setToolLength(double length) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!flange_) throw Error("tool length: the spindle has no force sensor that depends on it");
    flange_->setLength(length);
  }

  void setTapPoint(const std::array<double, 3>& point) {
    const std::lock_guard<std::mutex> lock(mutex_);
    tap_point_ = point;
  }

  void skipSamples(std::uint64_t samples) {
    const std::lock_guard<std::mutex> lock(mutex_);
    index_ += samples;
    const double time = static_cast<double>(samples) / SAMPLE_RATE;
    if (workpiece_hit_) workpiece_hit_->begin += time;
    if (tool_hit_) tool_hit_->begin += time;
    if (flange_) flange_->skipTime(time);
    if (station_) station_->skipTime(time);
  }

 private:
  static ControllerOptions controllerOptions(const MachineModel& model, const WorldOptions& options) {
    ControllerOptions controller_options = ControllerOptions::ofModel(model);
    if (model.spindle->load_meter_full_scale) {
      controller_options.load_step = 100.0 * options.load_step / *model.spindle->load_meter_full_scale;
    }
    return controller_options;
  }

  double uniform() { return std::uniform_real_distribution<double>(0.0, 1.0)(random_); }
  double scattered(double peak) {
    return peak * std::clamp(1.0 + options_.force_scatter * normal_(random_), 0.5, 1.5);
  }
  double noise(double rms) { return rms * normal_(random_); }
  /// Hit by an automatic hammer or by hand.
  Hit drawHit(double now) {
    const double delay = options_.operator_delay > 0.0 ? options_.operator_delay : HAMMER_DELAY;
    const double begin = now + delay + uniform() / SAMPLE_RATE;
    return {begin, scattered(options_.tap_peak), options_.tap_contact, 0.0};
  }

  void simulateBlock(Block& block, const std::vector<MotionState>& states) {
    prepareBlock(block);
    torque_ = 0.0;
    for (std::size_t i = 0; i < BLOCK; ++i) {
      if ((index_ + i) % CONTACT_UPDATE == 0) updateContact(states[i]);
      sample(static_cast<double>(index_ + i) / SAMPLE_RATE, states[i], block);
      last_ = states[i];
    }
    for (std::size_t k = 0; k < ANGLES; ++k) {
      const std::size_t i = BLOCK * (k + 1) / ANGLES - 1;
      block.angle[k] = {(static_cast<double>(index_ + i) + 0.5) / SAMPLE_RATE, states[i].spindle_angle,
                        states[i].spindle_speed};
    }
    index_ += BLOCK;
    block.servo = servo_.take();
    if (motors_) block.motor_current = motors_->take();
    block.spindle_load = machine_.rounded(load_meter_) / *spindle_.load_meter_full_scale;
  }

  void prepareBlock(Block& block) const {
    const double stamp = static_cast<double>(index_) / SAMPLE_RATE;
    const auto prepare = [&](SampleBlock& b, std::vector<std::string> channels,
                             std::vector<std::string> units) {
      b.stamp = stamp;
      b.sample_rate = SAMPLE_RATE;
      b.first_index = index_;
      b.channels = std::move(channels);
      b.units = std::move(units);
      b.samples.clear();
      b.samples.reserve(BLOCK * b.channels.size());
    };
    prepare(block.hammer, {"hammer", "gap"}, {"N", "V"});
    if (station_ && station_->hasCross())
      prepare(block.hammer, {"hammer", "gap", "gap_cross"}, {"N", "V", "V"});
    const auto named = [](auto first, auto last) { return std::vector<std::string>(first, last); };
    prepare(block.dynamometer, named(PLATE_CHANNELS.begin(), PLATE_CHANNELS.begin() + (plate_ ? 6 : 3)),
            {"N", "N", "N"});
    if (plate_) block.dynamometer.units.insert(block.dynamometer.units.end(), 3, "N m");
    if (flange_) {
      prepare(block.spindle_force, named(SPINDLE_SENSOR_CHANNELS.begin(), SPINDLE_SENSOR_CHANNELS.end()),
              std::vector<std::string>(6, "N"));
    }
    prepare(block.vibration, {"x", "y"}, {"m", "m"});
    block.force.stamp = stamp;
    block.force.sample_rate = SAMPLE_RATE;
    block.force.first_index = index_;
    block.force.status = ForceBlock::Status::measured;
    for (std::vector<double>& axis : block.force.force) axis.clear();
  }

  ToolMotion between(const MotionState& now, double share) const {
    ToolMotion motion;
    motion.angle =
        last_.spindle_angle + share * std::remainder(now.spindle_angle - last_.spindle_angle, units::TWO_PI);
    motion.speed = last_.spindle_speed + share * (now.spindle_speed - last_.spindle_speed);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      motion.centre[axis] = last_.position[axis] + share * (now.position[axis] - last_.position[axis]);
      motion.velocity[axis] = now.velocity[axis];
    }
    return motion;
  }

  /// Updates the contact of tool and stock.
  void updateContact(const MotionState& state) {
    if (!stock_) return;
    std::vector<ContactArc> arcs = stock_->contact(state.position, state.velocity);
    if (!arcs.empty() && state.spindle_speed < TURNING) {
      raiseAlarm(TOUCHED, "TOOL MET STOCK WITH SPINDLE AT REST");
      arcs.clear();
    }
    if (state.velocity[2] < 0.0 && stock_->hasMaterialAbove(state.position)) {
      raiseAlarm(PLUNGED, "TOOL PLUNGED INTO STOCK");
      arcs.clear();
    }
    if (!arcs.empty() || machine_.cutting()) {
      stock_->cutTo(state.position);
    } else {
      stock_->endSlot();
    }
    if (!isSameContact(arcs, arcs_)) {
      arcs_ = arcs;
      machine_.engage(arcs, between(state, 0.0));
    }
  }

  void raiseAlarm(int number, const char* text) {
    if (controller_.status().alarm == 0) controller_.raiseAlarm(number, text);
  }

  /// Forces on the tool in addition to cut and station [N]: weights and manual hits.
  std::array<double, 3> manualForces(double at, CuttingMachine::Input& input, double& tap) const {
    std::array<double, 3> tip = pull_;
    if (tool_hit_) {
      const double hit = tool_hit_->force(at);
      tip[tool_hit_axis_] += hit;
      if (tool_hit_axis_ < 2) input.tip_force[tool_hit_axis_] += hit;
      tap += hit;
    }
    for (std::size_t axis = 0; axis < 3 && pull_on_table_; ++axis) input.sensor_force[axis] += pull_[axis];
    return tip;
  }

  /// Steps the sensors in the flange and the plate.
  void stepFurtherSensors(const CuttingMachine::Input& input, const HammerStation::Push& push,
                          const std::array<double, 3>& tip, const std::array<double, 3>& workpiece_force,
                          double height, const CuttingMachine::Output& out) {
    if (flange_) {
      flange_->step({out.force.fx + push.tip_force[0] + tip[0], out.force.fy + push.tip_force[1] + tip[1],
                     out.force.fz + tip[2]},
                    input.motion.angle, input.motion.speed);
    }
    if (!plate_) return;
    std::array<double, 3> cut = out.applied;
    for (std::size_t axis = 0; axis < 3; ++axis) cut[axis] -= workpiece_force[axis];
    plate_->step(cut, {input.motion.centre[0], input.motion.centre[1], height}, workpiece_force, tap_point_);
  }

  /// Simulates a sample. Sensor signals are averaged over the interval centred on the sample, as by an
  /// anti-aliasing filter: otherwise the spectrum of a short hit above half the sample rate would alias
  /// differently in force and response. @param now state half a sample after the sample
  void sample(double time, const MotionState& now, Block& block) {
    if (station_) station_->setPose({now.position, now.spindle_angle, now.spindle_speed}, random_);
    std::array<double, 3> sensor{}, force{};
    std::array<double, 2> displacement{};
    double tap = 0.0, torque = 0.0;
    for (int s = 0; s < options_.substeps; ++s) {
      const double share = (s + 0.5) / options_.substeps, at = time + (share - 0.5) / SAMPLE_RATE;
      CuttingMachine::Input input;
      input.motion = between(now, share);
      HammerStation::Push push;
      if (station_) push = station_->push(at);
      input.tip_force = push.tip_force;
      if (workpiece_hit_) tap += input.sensor_force[workpiece_hit_axis_] = workpiece_hit_->force(at);
      const std::array<double, 3> workpiece_force = input.sensor_force;
      const std::array<double, 3> tip = manualForces(at, input, tap);
      const CuttingMachine::Output out = machine_.step(input);
      stepFurtherSensors(input, push, tip, workpiece_force, now.position[2], out);
      if (station_) station_->addDisplacement(out.displacement);
      for (std::size_t axis = 0; axis < 3; ++axis) sensor[axis] += out.sensor[axis];
      for (std::size_t axis = 0; axis < 2; ++axis)
        displacement[axis] += out.displacement[axis] + push.tip[axis];
      force[0] += out.force.fx;
      force[1] += out.force.fy;
      force[2] += out.force.fz;
      torque += out.force.torque;
      load_meter_ = out.load_meter;
    }
    const double share = 1.0 / options_.substeps;
    torque_ += share * torque;
    servo_.push({time,
                 now,
                 load_meter_ / *spindle_.load_meter_full_scale,
                 {share * force[0], share * force[1], share * force[2]}});
    if (motors_)
      motors_->push({time, now, {share * force[0], share * force[1], share * force[2]}, share * torque});
    HammerStation::Sample station_sample;
    if (station_) station_sample = station_->read(time, random_);
    if (station_ && station_->touched()) raiseAlarm(SENSOR, "TOOL MET THE DISPLACEMENT SENSOR");
    block.hammer.samples.push_back(share * tap + station_sample.force);
    block.hammer.samples.push_back(station_sample.gap);
    if (block.hammer.channels.size() > 2) block.hammer.samples.push_back(station_sample.cross);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!plate_) block.dynamometer.samples.push_back(share * sensor[axis] + noise(force_noise_[axis]));
      block.force.force[axis].push_back(share * force[axis]);
    }
    const auto append = [](SampleBlock& to, const std::array<double, 6>& values) {
      to.samples.insert(to.samples.end(), values.begin(), values.end());
    };
    if (plate_) append(block.dynamometer, plate_->read());
    if (flange_) append(block.spindle_force, flange_->read());
    for (double d : displacement) block.vibration.samples.push_back(share * d);
    if (workpiece_hit_ && workpiece_hit_->over(time)) workpiece_hit_.reset();
    if (tool_hit_ && tool_hit_->over(time)) tool_hit_.reset();
  }

  WorldOptions options_;
  Spindle spindle_;
  Controller controller_;
  ServoRecorder servo_;
  std::optional<MotorCurrents> motors_;
  std::optional<HammerStation> station_;
  ToolTip tip_;
  CuttingMachine machine_;
  std::optional<Stock> stock_;
  Axes3 force_noise_{{0, 0, 0}};

  std::mutex mutex_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::uint64_t index_ = 0;
  MotionState last_;  // half a sample after the last sample
  std::vector<MotionState> states_;
  std::vector<ContactArc> arcs_;
  std::optional<Hit> workpiece_hit_;  // on the workpiece
  std::size_t workpiece_hit_axis_ = 0;
  std::array<double, 3> tap_point_{};  // [m] point of the hit, from the plate's origin
  std::optional<Hit> tool_hit_;        // manual hit on the tool
  std::size_t tool_hit_axis_ = 0;
  std::array<double, 3> pull_{};  // [N] at the tool's tip
  bool pull_on_table_ = false;
  std::optional<SpindleSensor> flange_;
  std::optional<Plate> plate_;
  double load_meter_ = 0.0;  // [V]
  double torque_ = 0.0;      // [N m] cutting torque, summed over the samples of a block
};

World::World(const MachineModel& model, const WorldOptions& options) {
  options.validate();
  impl_ = std::make_unique<Impl>(model, options);
}

World::~World() = default;

Controller& World::controller() {
  return impl_->controller();
}

const ToolTip& World::toolTip() const {
  return impl_->toolTip();
}

World::StrikeAnswer World::strike(const std::string& point, const std::string& direction,
                                  std::string& message) {
  return impl_->strike(point, direction, message);
}

void World::pull(const std::array<double, 3>& force, bool on_table) {
  impl_->pull(force, on_table);
}

void World::setToolLength(double length) {
  impl_->setToolLength(length);
}

void World::setTapPoint(const std::array<double, 3>& point) {
  impl_->setTapPoint(point);
}

void World::advance(Block& block) {
  impl_->advance(block);
}

void World::advance(Block& block, const std::vector<MotionState>& states) {
  if (states.size() != BLOCK)
    throw Error("axes: " + std::to_string(states.size()) + " states, expected one block");
  impl_->advance(block, states);
}

void World::skipSamples(std::uint64_t samples) {
  impl_->skipSamples(samples);
}

}  // namespace smartmill::sim
