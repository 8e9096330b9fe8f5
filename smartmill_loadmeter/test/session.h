#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/load_meter.h"

namespace smartmill::loadmeter {

inline const CuttingCoefficients TRUTH{953e6, 0, 0, 17.3e3, 0, 0};
constexpr double VISCOUS = 4.743e-4, COULOMB = 0.0671, RATE = 50.0;

/// Nominal model of the machine.
inline MachineModel model() {
  MachineModel m;
  m.file = "model.yaml";
  Spindle s;
  s.viscous = 9e-4;  // wrong on purpose: the air cuts correct it
  s.coulomb = 0.5;
  s.load_meter_gain = 3.88e-4;
  s.load_meter_bandwidth = 7.0;
  s.load_meter_resolution = 3e-4;
  s.load_meter_full_scale = 8.0;
  m.spindle = s;
  return m;
}

/// Simulated machine with air cuts and slots; its outputs are passed on in stamp order.
class Session {
 public:
  Session(unsigned seed, double noise) : random_(seed), angle_random_(seed), noise_(noise) {}

  std::function<void(const CncState&)> state = [](const CncState&) {};
  std::function<void(const LoadSample&)> load = [](const LoadSample&) {};
  std::function<void(const CuttingCondition&)> condition = [](const CuttingCondition&) {};

  void air(double rpm, double seconds) {
    announce(CuttingCondition::Kind::air, rpm, 0.0, "air_" + std::to_string(static_cast<int>(rpm)));
    accelerateTo(rpm);
    run(seconds, 0.0, 0.0);
    announce(CuttingCondition::Kind::none, 0.0, 0.0, "");
    run(0.1, 0.0, 0.0);  // conditions with the same stamp would have no order
  }

  void slot(double rpm, double feed, double seconds) {
    announce(CuttingCondition::Kind::cut, rpm, feed, "slot_" + std::to_string(feed));
    accelerateTo(rpm);
    const double speed = units::radPerSecFromRpm(rpm) / units::TWO_PI * 3 * feed;  // [m/s]
    position_ = 0.1 - 0.3 * speed;
    run(0.3, speed, 0.0);  // in air, then immediately in full cut
    const Engagement e{0.0, units::PI, 0.002, feed};
    const CuttingForce force = MechanisticForce(TOOL, cutting, e).mean();
    x_force_ = force.fx;
    if (ripple) {
      ripple_ = torqueOverARevolution(e);
      if (any_angle) angle_ = units::TWO_PI * uniform_(angle_random_);
    }
    run(seconds, speed, force.torque);
    ripple_.clear();
    x_force_ = 0.0;
    run(0.3, speed, 0.0);
    announce(CuttingCondition::Kind::none, 0.0, 0.0, "");
    run(0.1, 0.0, 0.0);
  }

  /// Moves along X in air with a rotating spindle, for the friction of the feed drive.
  void airPass(double rpm, double feed, double seconds) {
    announce(CuttingCondition::Kind::air, rpm, feed, "pass_" + std::to_string(feed));
    accelerateTo(rpm);
    position_ = 0.1;
    run(seconds, units::radPerSecFromRpm(rpm) / units::TWO_PI * 3 * feed, 0.0);
    announce(CuttingCondition::Kind::none, 0.0, 0.0, "");
    run(0.1, 0.0, 0.0);
  }

  /// Phase currents at 1 kHz if set; channels x, y at rest, spindle.
  std::function<void(const SampleBlock&)> currents;
  CuttingCoefficients cutting = TRUTH;
  static constexpr double X_NEWTON_PER_AMPERE = 200.0, X_AIR = 1.5, PHASE_PER_METRE = 400.0;

  /// The load meter contains the ripple of the teeth; otherwise a cut is its mean torque.
  bool ripple = false;
  /// With the ripple: each slot starts at another spindle angle.
  bool any_angle = false;
  /// With the ripple: offset of the cutter axis [m] and its angle [rad].
  double runout = 0.0, runout_angle = 0.0;

  double now() const { return time_; }
  std::string tool = "endmill", material = "aluminium";

 private:
  void announce(CuttingCondition::Kind kind, double rpm, double feed, const std::string& name) {
    CuttingCondition c;
    c.stamp = time_;
    c.kind = kind;
    c.name = name;
    c.tool_name = tool;
    c.material = material;
    c.tool = TOOL;
    c.engagement = {0.0, units::PI, 0.002, feed};
    c.spindle_speed = units::radPerSecFromRpm(rpm);
    c.steady_from = {0.1, 0.2, -0.1};
    c.steady_to = {0.1 + 4.0 * units::radPerSecFromRpm(rpm) / units::TWO_PI * 3 * feed, 0.2, -0.1};
    condition(c);
  }

  void accelerateTo(double rpm) {
    const double goal = units::radPerSecFromRpm(rpm), step = 800.0 / RATE;
    while (std::abs(goal - speed_) > step) {
      speed_ += goal > speed_ ? step : -step;
      tick(0.0, 5.0);  // acceleration requires torque
    }
    speed_ = goal;
  }

  void run(double seconds, double feed_speed, double torque) {
    for (int i = 0; i < std::lround(seconds * RATE); ++i) tick(feed_speed, torque);
  }

  // The rule of effects.md, angle by angle and slice by slice: h is the smallest distance to the surface of
  // any earlier pass, with the curvature of the tool.
  std::vector<double> torqueOverARevolution(const Engagement& e) const {
    constexpr int ANGLES = 720, SLICES = 8, PASSES = 8;
    std::vector<double> torque(ANGLES, 0.0);
    std::vector<double> radii;
    for (int tooth = 0; tooth < TOOL.teeth; ++tooth)
      radii.push_back(runout * std::cos(runout_angle - TOOL.toothAngle(tooth)));
    const double dz = e.axial_depth / SLICES, c = e.feed_per_tooth;
    for (int i = 0; i < ANGLES * SLICES * TOOL.teeth; ++i) {
      const int angle = i % ANGLES, slice = i / ANGLES % SLICES, tooth = i / ANGLES / SLICES;
      double phi = units::TWO_PI * angle / ANGLES + TOOL.toothAngle(tooth) - TOOL.lag() * (slice + 0.5) * dz;
      phi -= units::TWO_PI * std::floor(phi / units::TWO_PI);
      if (phi > units::PI) continue;
      const double along = c * std::sin(phi), curved = std::pow(c * std::cos(phi), 2) / TOOL.diameter;
      double h = 1.0;
      for (int n = 1; n <= PASSES; ++n) {
        const auto at = static_cast<std::size_t>((tooth + n) % TOOL.teeth);
        h = std::min(h,
                     n * along + (n * n - 1) * curved + radii[static_cast<std::size_t>(tooth)] - radii[at]);
      }
      if (h > 0.0)
        torque[static_cast<std::size_t>(angle)] += (cutting.ktc * h + cutting.kte) * dz * TOOL.radius();
    }
    return torque;
  }

  // Torque at the spindle angle; without ripple the mean.
  double torqueNow(double mean) const {
    if (ripple_.empty()) return mean;
    const double turn = angle_ / units::TWO_PI;
    return ripple_[static_cast<std::size_t>((turn - std::floor(turn)) * static_cast<double>(ripple_.size()))];
  }

  void tick(double feed_speed, double torque) {
    time_ += 1.0 / RATE;
    position_ += feed_speed / RATE;
    const int steps = ripple_.empty() ? 1 : 200;
    const double dt = 1.0 / RATE / steps, a = std::exp(-dt / timeConstant(7.0));
    for (int i = 0; i < steps; ++i) {
      angle_ += speed_ * dt;
      const double power = (torqueNow(torque) + VISCOUS * speed_ + COULOMB) * speed_;
      lagged_ = a * lagged_ + (1.0 - a) * 3.88e-4 * power;
    }
    if (currents) {
      SampleBlock block;
      block.sample_rate = 1000.0;
      block.stamp = time_ - 1.0 / RATE;
      block.first_index = index_;
      block.channels = {"x", "y"};
      block.units = {"A", "A"};
      index_ += 20;
      // At rest the brake holds and the phase is constant: noise only.
      const double range = feed_speed > 0.0 ? X_AIR - x_force_ / X_NEWTON_PER_AMPERE : 0.0;
      for (int i = 0; i < 20; ++i) {
        phase_ += units::TWO_PI * PHASE_PER_METRE * feed_speed / block.sample_rate;
        block.samples.push_back(0.5 * range * (std::sin(phase_) + 0.05 * std::sin(5.0 * phase_)) +
                                0.05 * hall_(hall_random_));
        block.samples.push_back(3.0 + 0.05 * hall_(hall_random_));
      }
      currents(block);
    }
    CncState s;
    s.stamp = time_ - 0.004;
    s.connected = true;
    s.motion = feed_speed > 0.0;
    s.axes = {"X", "Y", "Z"};
    s.position = {position_, 0.2, -0.1};
    s.distance_to_go = {0.0, 0.0, 0.0};
    state(s);
    LoadSample l;
    l.stamp = time_;
    l.spindle_speed = speed_ * (1.0 + 0.001 * normal_(random_));
    l.spindle_load = 3e-4 * std::round((lagged_ + noise_ * normal_(random_)) / 3e-4) / 8.0;
    load(l);
  }

  const ToolGeometry TOOL{3, 0.012, units::radFromDeg(35.0), {}};
  std::mt19937 random_, angle_random_;
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_;
  double noise_;
  double time_ = 1000.0, position_ = 0.0, speed_ = 0.0, lagged_ = 0.0;
  double x_force_ = 0.0, phase_ = 0.0, angle_ = 0.0;
  std::vector<double> ripple_;  // [N m] over a revolution, in a cut with runout
  std::uint64_t index_ = 0;
  std::mt19937 hall_random_{9};
  std::normal_distribution<double> hall_;
};

/// Three air cuts and three slots. At 6000 rpm the readings, one per two revolutions, sample a single phase.
inline void runStandardTests(Session& session, double rpm = 6000.0) {
  for (const double in_air : {2000.0, 6000.0, 12000.0}) session.air(in_air, 3.0);
  for (const double feed : {3e-5, 6e-5, 1e-4}) session.slot(rpm, feed, 4.0);
}

}  // namespace smartmill::loadmeter
