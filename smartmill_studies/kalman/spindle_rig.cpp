#include "kalman/spindle_rig.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

constexpr double BLOCK_TIME = sim::World::BLOCK / sim::World::SAMPLE_RATE;  // [s]
constexpr double SETTLES = 0.25;  // [s] settling after a change of load
constexpr double READS = 0.25;    // [s] duration of a measurement

}  // namespace

SpindleRig::SpindleRig(const MachineModel& model, const sim::WorldOptions& options,
                       const CompensationParameters& filter, const TapParameters& taps, bool use_plate)
    : model_(model), world_(model, options), use_plate_(use_plate) {
  ForceSensor ideal;
  for (ModalModel& axis : ideal.axis) axis.direct = 1.0;
  CompensationPipeline::Outputs outputs;
  const auto append = [this](std::array<std::vector<double>, 3>& to, const ForceBlock& block) {
    if (!recording_ || block.stamp < from_ - 1e-6) return;
    for (std::size_t axis = 0; axis < 3; ++axis)
      to[axis].insert(to[axis].end(), block.force[axis].begin(), block.force[axis].end());
  };
  outputs.force.measured = [this, append](const ForceBlock& block) { append(record_.measured, block); };
  outputs.force.compensated = [this, append](const ForceBlock& block) { append(record_.compensated, block); };
  outputs.strike = [this](const StrikeCommand& command) {
    std::string message;
    world_.strike(use_plate_ ? "force_sensor" : "tool", command.direction, message);
  };
  outputs.result = [this](const SensorResult& result) { tapped_ = result; };
  outputs.calibration = [this](const CalibrationResult& result) { calibration_ = result; };
  // Without hold-back every block is output at once.
  sorted_ = std::make_unique<CompensationPipeline>(filter, taps, ideal, 0.0, outputs);
  sorted_->forces().spindle().allowUncalibrated();
  if (options.pulse_train) tachometer_.emplace(PulseTachometerParameters());
}

void SpindleRig::run(double seconds, const std::array<double, 3>& velocity) {
  const auto blocks = static_cast<int>(std::ceil(seconds / BLOCK_TIME - 1e-9));
  std::vector<sim::MotionState> states(sim::World::BLOCK);
  sim::World::Block block;
  const double step = 1.0 / sim::World::SAMPLE_RATE;
  for (int b = 0; b < blocks; ++b) {
    for (sim::MotionState& state : states) {
      // Half a sample after each sample.
      for (std::size_t axis = 0; axis < 3; ++axis) position_[axis] += velocity[axis] * step;
      angle_ = std::fmod(angle_ + speed_ * step, units::TWO_PI);
      state.position = position_;
      state.velocity = velocity;
      state.spindle_angle = angle_;
      state.spindle_speed = speed_;
    }
    world_.advance(block, states);
    hear(block);
    now_ += BLOCK_TIME;
  }
}

void SpindleRig::hear(const sim::World::Block& block) {
  if (recording_) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto& force = block.force.force[axis];
      record_.truth[axis].insert(record_.truth[axis].end(), force.begin(), force.end());
    }
    for (std::size_t i = 0; i < sim::World::BLOCK; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis)
        record_.dynamometer[axis].push_back(block.dynamometer.at(i, axis));
      const SampleBlock& six = use_plate_ ? block.dynamometer : block.spindle_force;
      for (std::size_t k = 0; k < six.channels.size() && k < 6; ++k)
        record_.sensors[k].push_back(six.at(i, k));
      record_.hammer.push_back(block.hammer.at(i, 0));
      const SpindleAngle& angle = block.angle[0];
      record_.angle.push_back(angle.angle + angle.speed * (block.force.stamp - angle.stamp) +
                              angle.speed * static_cast<double>(i) / sim::World::SAMPLE_RATE);
    }
  }
  if (tachometer_) {
    for (const PulseReading& reading : tachometer_->push(block.tachometer)) sorted_->push(reading.angle);
  } else {
    for (const SpindleAngle& angle : block.angle) sorted_->push(angle);
  }
  sorted_->pushHammer(block.hammer);
  sorted_->push(use_plate_ ? block.dynamometer : block.spindle_force);
}

void SpindleRig::publishCondition(CuttingCondition::Kind kind, const Engagement& engagement) {
  CuttingCondition condition;
  condition.stamp = now_;
  condition.kind = kind;
  condition.name = "rig";
  condition.tool = model_.needTool("cut");
  condition.engagement = engagement;
  condition.spindle_speed = speed_;
  sorted_->push(condition);
}

CalibrationResult SpindleRig::ask(const CalibrationGoal& goal) {
  calibration_.reset();
  CalibrationGoal stamped = goal;
  stamped.stamp = now_;
  sorted_->push(stamped);
  for (int k = 0; k < 400 && !calibration_; ++k) run(BLOCK_TIME);
  if (!calibration_) throw Error("rig: no result of a calibration step");
  if (calibration_->code == CalibrationResult::Code::ok || goal.step == CalibrationGoal::Step::verify)
    return *calibration_;
  throw Error("rig: " + calibration_->message);
}

void SpindleRig::readStatic(const std::vector<double>& lengths, const std::vector<double>& loads,
                            bool reference) {
  for (const double length : lengths) {
    world_.setToolLength(length);
    for (std::size_t axis = 0; axis < 3; ++axis, ++tests_) {
      for (const double load : loads) {
        CalibrationGoal goal;
        goal.test = tests_;
        goal.length = length;
        goal.load[axis] = load;
        goal.reference = reference;
        goal.duration = READS;
        world_.pull(goal.load, reference);
        run(SETTLES);
        ask(goal);
      }
      world_.pull({}, false);
    }
  }
}

SensorResult SpindleRig::tap(const std::string& direction, int hits) {
  tapped_.reset();
  MeasureFrfGoal goal;
  goal.stamp = now_;
  goal.point = POINT_FORCE_SENSOR;
  goal.direction = direction;
  goal.hits = hits;
  sorted_->push(goal);
  for (int k = 0; k < 100 * (hits + 10) && !tapped_; ++k) run(BLOCK_TIME);
  if (!tapped_) throw Error("rig: no result of taps along " + direction);
  return *tapped_;
}

void SpindleRig::start() {
  recording_ = true;
  from_ = now_;
}

int SpindleRig::slots() {
  return slots_++;
}

SpindleRig::Record SpindleRig::take() {
  recording_ = false;
  return std::exchange(record_, {});
}

SpindleRig::Record cutAlong(SpindleRig& rig, const MachineModel& model, double y,
                            const Engagement& engagement, double speed, double air, double seconds,
                            bool through) {
  const ToolGeometry& tool = model.needTool("cut");
  const Workpiece& stock = model.workpiece.value();
  const double advance = engagement.feed_per_tooth * tool.teeth * speed / units::TWO_PI;  // [m/s]
  rig.spin(speed);
  rig.publishCondition(CuttingCondition::Kind::air);
  rig.place({stock.low[0] - tool.radius() - 1e-3, y, stock.high[2] + 10e-3});
  rig.run(air);
  rig.publishCondition(CuttingCondition::Kind::cut, engagement);
  rig.place({stock.low[0] - tool.radius() - 0.1e-3, y, stock.high[2] - engagement.axial_depth});
  rig.run((tool.radius() + 0.5e-3) / advance + 0.1, {advance, 0.0, 0.0});
  rig.start();
  rig.run(seconds, {advance, 0.0, 0.0});
  SpindleRig::Record cut = rig.take();
  if (through) {
    const double way = stock.high[0] - stock.low[0] + 3.0 * tool.radius();
    rig.run(way / advance - seconds, {advance, 0.0, 0.0});
  }
  rig.place({stock.low[0], y, stock.high[2] + 10e-3});
  rig.publishCondition(CuttingCondition::Kind::none);
  // Skips blocks that were held back.
  for (auto* force : {&cut.truth, &cut.measured, &cut.dynamometer}) {
    for (auto& axis : *force) axis.resize(std::min(axis.size(), cut.compensated[2].size()));
  }
  return cut;
}

SpindleRig::Record cutSlot(SpindleRig& rig, const MachineModel& model, double speed, double depth,
                           double feed, double air, double seconds) {
  const Workpiece& stock = model.workpiece.value();
  // Each slot cuts fresh material.
  const double pitch = 1.15 * model.needTool("cut").diameter;
  const int rows = static_cast<int>((stock.high[1] - stock.low[1]) / pitch);
  const double y = stock.low[1] + pitch * (rig.slots() % rows + 0.5);
  return cutAlong(rig, model, y, {0.0, units::PI, depth, feed}, speed, air, seconds, false);
}

}  // namespace smartmill::kalman
