#include "world/world_sensor.h"

#include <cmath>
#include <string>
#include <utility>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/signal/pulse_tachometer.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/world/plate.h"
#include "smartmill_sim/world/spindle_sensor.h"

namespace smartmill::sim {
namespace {

using Names = std::vector<std::string>;

constexpr std::uint64_t PLATE_SEED = 0x2000;  // offset from the seed of the world
constexpr std::uint64_t TACHOMETER_SEED = 0x3000;
constexpr std::uint64_t MICROPHONE_SEED = 0x4000;

template <class T>
void beginBlock(T& block, double stamp, std::uint64_t first_index) {
  block.stamp = stamp;
  block.sample_rate = World::SAMPLE_RATE;
  block.first_index = first_index;
}

/// A sensor with one regular sample block.
class BlockSensor : public WorldSensor {
 public:
  BlockSensor(SampleBlock World::Block::*target, Names channels, Names units)
      : target_(target), channels_(std::move(channels)), units_(std::move(units)) {}

  void begin(double stamp, std::uint64_t first_index, World::Block& block) override {
    SampleBlock& to = block.*target_;
    beginBlock(to, stamp, first_index);
    to.channels = channels_;
    to.units = units_;
    to.samples.clear();
    to.samples.reserve(World::BLOCK * channels_.size());
  }

 protected:
  template <class Values>
  void append(const Values& values, World::Block& block) const {
    std::vector<double>& samples = (block.*target_).samples;
    samples.insert(samples.end(), values.begin(), values.end());
  }

 private:
  SampleBlock World::Block::*target_;
  Names channels_, units_;
};

class HammerSensor : public BlockSensor {
 public:
  HammerSensor(HammerStation* station, WorldRandom& random)
      : BlockSensor(&World::Block::hammer,
                    hasCross(station) ? Names{"hammer", "gap", "gap_cross"} : Names{"hammer", "gap"},
                    hasCross(station) ? Names{"N", "V", "V"} : Names{"N", "V"}),
        station_(station),
        random_(random) {}

  void step(const Step& step) override {
    force_ += step.manual.hammer;
    if (station_) station_->addDisplacement(step.output.displacement);
  }
  void read(const Sample& sample, World::Block& block) override {
    HammerStation::Sample at;
    if (station_) at = station_->read(sample.time, random_.engine);
    append(std::array<double, 2>{{sample.share * std::exchange(force_, 0.0) + at.force, at.gap}}, block);
    if (hasCross(station_)) append(std::array<double, 1>{{at.cross}}, block);
  }

 private:
  static bool hasCross(const HammerStation* station) { return station && station->hasCross(); }

  HammerStation* station_;
  WorldRandom& random_;
  double force_ = 0.0;  // [N] summed over the steps
};

class ForceSensor : public BlockSensor {
 public:
  ForceSensor(const Axes3& noise, WorldRandom& random)
      : BlockSensor(&World::Block::dynamometer, {PLATE_CHANNELS.begin(), PLATE_CHANNELS.begin() + 3},
                    {"N", "N", "N"}),
        noise_(noise),
        random_(random) {}

  void step(const Step& step) override {
    for (std::size_t axis = 0; axis < 3; ++axis) sum_[axis] += step.output.sensor[axis];
  }
  void read(const Sample& sample, World::Block& block) override {
    for (std::size_t axis = 0; axis < 3; ++axis)
      sum_[axis] = sample.share * sum_[axis] + random_.gaussian(noise_[axis]);
    append(std::exchange(sum_, {}), block);
  }

 private:
  Axes3 noise_;
  WorldRandom& random_;
  std::array<double, 3> sum_{};  // [N] over the steps
};

class PlateSensor : public BlockSensor {
 public:
  PlateSensor(const PlateTraits& traits, double step, std::uint64_t seed, const ManualForces& manual)
      : BlockSensor(&World::Block::dynamometer, {PLATE_CHANNELS.begin(), PLATE_CHANNELS.end()},
                    {"N", "N", "N", "N m", "N m", "N m"}),
        plate_(traits, step, seed),
        manual_(manual) {}

  void step(const Step& step) override {
    const std::array<double, 3>& hit = step.manual.workpiece;
    std::array<double, 3> cut = step.output.applied;
    for (std::size_t axis = 0; axis < 3; ++axis) cut[axis] -= hit[axis];
    const std::array<double, 2>& centre = step.input.motion.centre;
    plate_.step(cut, {centre[0], centre[1], step.height}, hit, manual_.tap_point);
  }
  void read(const Sample& /*sample*/, World::Block& block) override { append(plate_.read(), block); }

 private:
  Plate plate_;
  const ManualForces& manual_;
};

class FlangeSensor : public BlockSensor {
 public:
  explicit FlangeSensor(SpindleSensor& flange)
      : BlockSensor(&World::Block::spindle_force,
                    {SPINDLE_SENSOR_CHANNELS.begin(), SPINDLE_SENSOR_CHANNELS.end()}, Names(6, "N")),
        flange_(flange) {}

  void step(const Step& step) override {
    const CuttingForce& cut = step.output.force;
    const std::array<double, 2>& push = step.push.tip_force;
    const std::array<double, 3>& tip = step.manual.tip;
    flange_.step({cut.fx + push[0] + tip[0], cut.fy + push[1] + tip[1], cut.fz + tip[2]},
                 step.input.motion.angle, step.input.motion.speed);
  }
  void read(const Sample& /*sample*/, World::Block& block) override { append(flange_.read(), block); }

 private:
  SpindleSensor& flange_;
};

/// Optical sensor at a mark on the spindle, with a digital output.
class TachometerSensor : public BlockSensor {
 public:
  explicit TachometerSensor(std::uint64_t seed)
      : BlockSensor(&World::Block::tachometer, {TACHOMETER_CHANNEL}, {"V"}),
        random_{std::mt19937_64(seed), {}} {}

  void read(const Sample& sample, World::Block& block) override {
    constexpr double HIGH = 5.0, NOISE = 0.02;    // [V]
    constexpr double MARK = 0.1 * units::TWO_PI;  // [rad] a sample at 150,000 rpm
    const double angle =
        wrapped(sample.motion.spindle_angle - 0.5 * sample.motion.spindle_speed / World::SAMPLE_RATE);
    append(std::array<double, 1>{{(angle < MARK ? HIGH : 0.0) + random_.gaussian(NOISE)}}, block);
  }

 private:
  WorldRandom random_;
};

/// Pressure next to the tool: that of a tip that moves, the orders of the spindle and noise of the workshop.
class Microphone : public BlockSensor {
 public:
  explicit Microphone(std::uint64_t seed)
      : BlockSensor(&World::Block::sound, {"sound"}, {"Pa"}), random_{std::mt19937_64(seed), {}} {}

  void step(const Step& step) override {
    constexpr double SIDE = 0.6;  // [1] of the acceleration in y: the microphone is nearer to the x direction
    displacement_ += step.output.displacement[0] + SIDE * step.output.displacement[1];
  }
  void read(const Sample& sample, World::Block& block) override {
    constexpr double RADIATED = 2e-3;                // [Pa/(m/s2)] 94 dB at 500 m/s2
    constexpr double SPINDLE = 0.01, NOISE = 0.004;  // [Pa] amplitude of the first order, RMS
    constexpr std::array<int, 4> ORDERS{1, 2, 3, 5};
    const double at = sample.share * std::exchange(displacement_, 0.0);
    const double acceleration = (at - 2.0 * last_ + before_) * World::SAMPLE_RATE * World::SAMPLE_RATE;
    before_ = std::exchange(last_, at);
    double pressure = RADIATED * acceleration + random_.gaussian(NOISE);
    if (sample.motion.spindle_speed > 0.0)
      for (const int order : ORDERS)
        pressure += SPINDLE / order * std::sin(order * sample.motion.spindle_angle);
    append(std::array<double, 1>{{pressure}}, block);
  }

 private:
  WorldRandom random_;
  double displacement_ = 0.0, last_ = 0.0, before_ = 0.0;  // [m] sum over the steps, of the last samples
};

class TrueValues : public BlockSensor {
 public:
  TrueValues() : BlockSensor(&World::Block::vibration, {"x", "y"}, {"m", "m"}) {}

  void begin(double stamp, std::uint64_t first_index, World::Block& block) override {
    BlockSensor::begin(stamp, first_index, block);
    beginBlock(block.force, stamp, first_index);
    block.force.status = ForceBlock::Status::measured;
    for (std::vector<double>& axis : block.force.force) axis.clear();
  }
  void step(const Step& step) override {
    for (std::size_t axis = 0; axis < 2; ++axis)
      displacement_[axis] += step.output.displacement[axis] + step.push.tip[axis];
  }
  void read(const Sample& sample, World::Block& block) override {
    for (std::size_t axis = 0; axis < 3; ++axis) block.force.force[axis].push_back(sample.force[axis]);
    for (double& d : displacement_) d *= sample.share;
    append(std::exchange(displacement_, {}), block);
  }

 private:
  std::array<double, 2> displacement_{};  // [m] summed over the steps
};

class ServoSensor : public WorldSensor {
 public:
  ServoSensor(ServoRecorder& recorder, double full_scale) : recorder_(recorder), full_scale_(full_scale) {}

  void read(const Sample& sample, World::Block& /*block*/) override {
    recorder_.push({sample.time, sample.motion, sample.load_meter / full_scale_, sample.force});
  }
  void end(World::Block& block) override { block.servo = recorder_.take(); }

 private:
  ServoRecorder& recorder_;
  double full_scale_;  // [V]
};

class MotorSensor : public WorldSensor {
 public:
  MotorSensor(const MotorTraits& traits, const Spindle& spindle, std::uint64_t seed)
      : currents_(traits, spindle, seed) {}

  void read(const Sample& sample, World::Block& /*block*/) override {
    currents_.push({sample.time, sample.motion, sample.force, sample.torque});
  }
  void end(World::Block& block) override { block.motor_current = currents_.take(); }

 private:
  MotorCurrents currents_;
};

}  // namespace

std::vector<std::unique_ptr<WorldSensor>> makeSensors(const SensorContext& c) {
  std::vector<std::unique_ptr<WorldSensor>> sensors;
  const auto add = [&](auto sensor) {
    sensors.push_back(std::make_unique<decltype(sensor)>(std::move(sensor)));
  };
  add(ServoSensor(c.servo, *c.model.spindle->load_meter_full_scale));
  if (c.options.motor.currents) add(MotorSensor(c.options.motor, *c.model.spindle, c.options.seed));
  add(HammerSensor(c.station, c.random));
  if (c.options.plate.present) {
    add(PlateSensor(c.options.plate, c.step, c.options.seed + PLATE_SEED, c.manual));
  } else {
    add(ForceSensor(c.model.force_sensor.noise_rms.value_or(Axes3{{0, 0, 0}}), c.random));
  }
  if (c.flange) add(FlangeSensor(*c.flange));
  if (c.options.pulse_train) add(TachometerSensor(c.options.seed + TACHOMETER_SEED));
  if (c.options.microphone) add(Microphone(c.options.seed + MICROPHONE_SEED));
  add(TrueValues());
  return sensors;
}

}  // namespace smartmill::sim
