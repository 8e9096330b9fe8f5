#include "loadmeter/motor_days.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/controller/path_move.h"
#include "smartmill_sim/world/world.h"

namespace smartmill::loadmeter {

namespace {

using units::TWO_PI;

// Published milling coefficients, N/m2 and N/m.
const std::vector<CuttingCoefficients> METALS{{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3},
                                              {1844e6, 513e6, 348e6, 24.0e3, 43.0e3, 3.0e3},
                                              {2172e6, 849e6, 726e6, 17.3e3, 7.8e3, 6.6e3},
                                              {1319e6, 789e6, 251e6, 23.5e3, 25.0e3, 2.0e3}};
constexpr double BASE_SPEED = 165.0;  // [rad/s], MotorTraits
constexpr double STATE_PERIOD = 0.02;
constexpr int FEED_BLOCK = 100;  // N word of the pass
constexpr int GROUP = 8;         // slots with one set of air cuts

MachineModel millModel() {
  MachineModel m;
  m.file = "motor_days";
  ToolGeometry tool;
  tool.teeth = 3;
  tool.diameter = 16e-3;
  tool.helix = 0.5;
  m.tool = tool;
  Spindle s;
  s.viscous = 1.5e-3;
  s.coulomb = 0.3;
  s.load_meter_gain = 8.0 / 8000.0;
  s.load_meter_bandwidth = 7.0;
  s.load_meter_resolution = 3e-4;
  s.load_meter_full_scale = 8.0;
  s.max_speed = units::radPerSecFromRpm(8000.0);
  s.acceleration = units::radPerSecFromRpm(20000.0);
  m.spindle = s;
  MachineAxes axes;
  axes.travel = {{{-0.4, 0.4}, {-0.4, 0.4}, {-0.2, 0.1}}};
  axes.rapid = 0.5;
  axes.acceleration = 5.0;
  m.axes = axes;
  Workpiece w;
  w.material = "metal";
  w.low = {-0.3, -0.3, -0.05};
  w.high = {0.3, 0.3, 0.0};
  m.workpiece = w;
  return m;
}

struct Pass {
  bool air = false;
  double speed = 0.0, feed = 0.0, depth = 0.0, heading = 0.0;  // [rad/s], [m], [m], [rad]
};

/// One machine over all passes; its samples are passed to the estimator in stamp order.
class Shop {
 public:
  Shop(const MotorDay& day, const MachineModel& model, LoadMeterIdentification& estimator)
      : day_(day), model_(model), estimator_(estimator) {}

  /// @return mean and variation of the true force over the second half of the pass, and the mean torque.
  MotorCut run(const Pass& pass, const CuttingCoefficients& metal, unsigned seed) {
    model_.cutting = metal;
    sim::World world(model_, worldOptions(seed));
    announce(pass);
    begin_ = time_;
    const auto blocks = static_cast<std::size_t>(day_.duration * sim::World::SAMPLE_RATE / sim::World::BLOCK);
    MotorCut cut;
    std::array<double, 3> squares{};
    double count = 0.0;
    for (std::size_t b = 0; b < blocks; ++b) {
      sim::World::Block block;
      world.advance(block, statesOf(pass, b));
      publish(pass, block);
      if (b < blocks / 2) continue;
      for (std::size_t i = 0; i < sim::World::BLOCK; ++i, ++count) {
        for (std::size_t a = 0; a < 3; ++a) {
          cut.force[a] += block.force.force[a][i];
          squares[a] += std::pow(block.force.force[a][i], 2);
        }
      }
    }
    for (std::size_t a = 0; a < 3; ++a) {
      cut.force[a] /= count;
      cut.rms[a] = std::sqrt(std::max(0.0, squares[a] / count - cut.force[a] * cut.force[a]));
    }
    cut.speed_rpm = units::rpmFromRadPerSec(pass.speed);
    cut.feed_per_tooth = pass.feed;
    cut.depth = pass.depth;
    cut.radius = model_.tool->radius();
    return cut;
  }

  /// Rapid traverse along an axis, from rest to rest.
  void rapid(std::size_t axis, unsigned seed) {
    constexpr double WAY = 0.08, BEFORE = 0.15, AFTER = 0.25;  // [m], [s]
    model_.cutting = METALS.front();                           // nothing is cut
    sim::World world(model_, worldOptions(seed));
    sim::PathMove move = sim::PathMove::line(
        {}, axis == 0 ? sim::PathMove::Point{WAY, 0.0, 0.0} : sim::PathMove::Point{0.0, WAY, 0.0});
    move.plan(BEFORE, model_.axes->rapid, model_.axes->acceleration);
    begin_ = time_;
    const auto blocks =
        static_cast<std::size_t>((move.end() + AFTER) * sim::World::SAMPLE_RATE / sim::World::BLOCK);
    for (std::size_t b = 0; b < blocks; ++b) {
      std::vector<sim::MotionState> states(sim::World::BLOCK);
      for (std::size_t i = 0; i < states.size(); ++i) {
        const double t = std::max(
            BEFORE, (static_cast<double>(b * sim::World::BLOCK + i) + 0.5) / sim::World::SAMPLE_RATE);
        states[i].position = move.position(t);
        states[i].position[2] = 5e-3;
        states[i].velocity = move.velocity(t);
      }
      sim::World::Block block;
      world.advance(block, states);
      time_ = begin_ + block.dynamometer.timeOf(sim::World::BLOCK);
      tellState(states.back().position, 0.0, block);
      tellCurrents(block);
    }
    end();
  }

  void end() {
    CuttingCondition none;
    none.stamp = time_ += 0.01;
    estimator_.handle(none);
    time_ += 1.0;
  }

 private:
  sim::WorldOptions worldOptions(unsigned seed) const {
    sim::WorldOptions options;
    options.seed = seed;
    options.substeps = 1;
    options.servo_trigger = FEED_BLOCK;
    options.motor.currents = true;
    options.motor.temperature = day_.temperature;
    options.motor.warm_up_time = 1e6;  // a pass is short: the temperature is constant
    return options;
  }

  double velocity(const Pass& pass) const { return pass.speed / TWO_PI * model_.tool->teeth * pass.feed; }

  std::vector<sim::MotionState> statesOf(const Pass& pass, std::size_t b) const {
    std::vector<sim::MotionState> states(sim::World::BLOCK);
    for (std::size_t i = 0; i < states.size(); ++i) {
      const double t = (static_cast<double>(b * sim::World::BLOCK + i) + 0.5) / sim::World::SAMPLE_RATE;
      sim::MotionState& s = states[i];
      const double v = velocity(pass);
      s.velocity = {v * std::cos(pass.heading), v * std::sin(pass.heading), 0.0};
      for (std::size_t a = 0; a < 3; ++a) {
        if (std::abs(s.velocity[a]) < 1e-12) s.velocity[a] = 0.0;
      }
      // The spindle rotates before the tool engages.
      s.position = {s.velocity[0] * t, s.velocity[1] * t, pass.air || b == 0 ? 5e-3 : -pass.depth};
      s.spindle_speed = pass.speed;
      s.sequence = b == 0 ? 1 : FEED_BLOCK;
      s.spindle_angle = std::fmod(pass.speed * t, TWO_PI);
    }
    return states;
  }

  void announce(const Pass& pass) {
    CuttingCondition c;
    c.stamp = time_;
    c.kind = pass.air ? CuttingCondition::Kind::air : CuttingCondition::Kind::cut;
    c.name = (pass.air ? "air_" : "slot_") + std::to_string(++passes_);
    c.tool_name = "endmill";
    c.material = "metal";
    c.tool = *model_.tool;
    c.engagement = {0.0, units::PI, std::max(pass.depth, 1e-3), pass.feed};
    c.spindle_speed = pass.speed;
    const double length = velocity(pass) * day_.duration;
    c.steady_from = {0.0, 0.0, pass.air ? 5e-3 : -pass.depth};
    c.steady_to = {length * std::cos(pass.heading), length * std::sin(pass.heading), c.steady_from[2]};
    estimator_.handle(c);
    length_ = length;
  }

  void publish(const Pass& pass, const sim::World::Block& block) {
    // One block later, when all its samples are measured.
    time_ = begin_ + block.dynamometer.timeOf(sim::World::BLOCK);
    const double t = time_ - begin_, way = std::min(length_, velocity(pass) * t);
    tellState({way * std::cos(pass.heading), way * std::sin(pass.heading), pass.air ? 5e-3 : -pass.depth},
              pass.speed, block);
    tellCurrents(block);
    if (!day_.force_sensor) return;
    ForceBlock force;
    force.stamp = begin_ + block.dynamometer.stamp;
    force.sample_rate = block.dynamometer.sample_rate;
    force.status = ForceBlock::Status::compensated;
    for (std::size_t i = 0; i < block.dynamometer.size(); ++i) {
      for (std::size_t a = 0; a < 3; ++a) force.force[a].push_back(block.dynamometer.at(i, a));
    }
    estimator_.handle(force);
  }

  void tellState(const std::array<double, 3>& position, double speed, const sim::World::Block& block) {
    if (time_ - told_ <= STATE_PERIOD - 1e-9) return;
    CncState state;
    state.stamp = time_;
    state.connected = state.motion = true;
    state.axes = {"X", "Y", "Z"};
    state.position = {position[0], position[1], position[2]};
    state.distance_to_go = {0.0, 0.0, 0.0};
    state.spindle_speed = speed;
    estimator_.handle(state);
    LoadSample load;
    load.stamp = time_;
    load.spindle_load = block.spindle_load;
    load.spindle_speed = speed;
    estimator_.handle(load);
    told_ = time_;
  }

  void tellCurrents(const sim::World::Block& block) {
    SampleBlock currents = day_.servo ? block.servo : block.motor_current;
    currents.stamp += begin_;
    estimator_.handle(currents);
  }

  MotorDay day_;
  MachineModel model_;
  LoadMeterIdentification& estimator_;
  double time_ = 100.0, begin_ = 0.0, told_ = 0.0, length_ = 0.0;
  int passes_ = 0;
};

IdentificationParameters estimatorParameters() {
  IdentificationParameters p;
  p.motor.phase_per_metre = {400.0, 400.0, 400.0};
  p.motor.phase_per_revolution = 2.0;
  p.largest_runout = 0.0;
  return p;
}

}  // namespace

std::vector<MotorCut> runDay(const MotorDay& day, const std::optional<MotorCalibration>& calibration,
                             const std::function<void(double)>& progress) {
  std::mt19937_64 random(day.seed);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  std::vector<MotorCut> all;
  const MachineModel model = millModel();
  std::optional<LoadMeterIdentification> estimator;
  std::optional<Shop> shop;
  std::optional<ForceEstimate> newest;
  std::vector<ForceEstimate> windows;
  for (int i = 0; i < day.cuts; ++i) {
    if (i % GROUP == 0) {
      estimator.emplace(model, estimatorParameters());
      day.learn ? estimator->forces().enableSelfCalibration()
                : estimator->forces().setMotors(calibration.value_or(MotorCalibration()));
      estimator->outputs().force = [&](const ForceEstimate& e) { newest = e; };
      estimator->outputs().force_window = [&](const ForceEstimate& e) { windows.push_back(e); };
      shop.emplace(day, model, *estimator);
      for (std::size_t a = 0; a < 2 && day.rapid_moves; ++a)
        shop->rapid(a, day.seed + static_cast<unsigned>(2 * i + static_cast<int>(a)));
    }
    Pass pass;
    // Incomplete revolutions are negligible: means are over half a pass.
    pass.speed =
        units::radPerSecFromRpm(uniform(0.0, 1.0) < 0.5 ? uniform(1000.0, 1500.0) : uniform(1700.0, 3500.0));
    pass.feed = uniform(0.06e-3, 0.2e-3);
    pass.depth = uniform(1e-3, 3e-3);
    pass.heading = day.diagonal ? units::PI / 4.0 * std::floor(uniform(0.0, 8.0))
                                : units::PI / 2.0 * std::floor(uniform(0.0, 4.0));
    const CuttingCoefficients& metal = METALS[random() % METALS.size()];
    // Two periods of a drive's phase at least in the steady part.
    pass.feed = std::max(pass.feed, 2.6 / 400.0 / (day.duration - 0.25) * units::TWO_PI / pass.speed *
                                        std::sqrt(2.0) / model.tool->teeth);
    Pass air = pass;
    air.air = true;
    shop->run(air, metal, static_cast<unsigned>(random()));
    shop->end();
    newest.reset();
    windows.clear();
    MotorCut cut = shop->run(pass, metal, static_cast<unsigned>(random()));
    shop->end();
    if (estimator->cuts().empty() || !estimator->cuts().back().motor || !estimator->airCuts().back().motor)
      throw Error("a pass without a motor measurement");
    cut.cut = *estimator->cuts().back().motor;
    cut.air = *estimator->airCuts().back().motor;
    cut.motors = estimator->cuts().back().force;
    cut.torque = MechanisticForce(*model.tool, metal, {0.0, units::PI, pass.depth, pass.feed}).mean().torque;
    cut.estimate = newest;
    cut.windows = windows;
    for (std::size_t a = 0; a < 3; ++a) cut.bandwidth[a] = estimator->forces().driveBandwidth(a);
    cut.learnt = estimator->forces().selfCalibration();
    all.push_back(cut);
    if (progress) progress(static_cast<double>(i + 1) / day.cuts);
  }
  return all;
}

MotorCalibration calibrationOf(const std::vector<MotorCut>& cuts) {
  std::vector<StandardCut> standard;
  std::vector<MachineCurrents> currents;
  for (const MotorCut& cut : cuts) {
    StandardCut s;
    MachineCurrents c;
    s.name = c.name = "cut" + std::to_string(standard.size());
    c.spindle_speed = cut.cut.spindle_speed;
    for (std::size_t a = 0; a < 3; ++a) {
      if (!cut.cut.range[a] || !cut.air.range[a]) continue;
      s.force[a] = cut.cut.velocity[a] > 0.0 ? -cut.force[a] : cut.force[a];
      c.current[a] = cut.cut.range[a];
      c.air[a] = cut.air.range[a];
    }
    s.torque = cut.torque;
    c.spindle_current = cut.cut.spindle_range;
    c.spindle_air = cut.air.spindle_range;
    standard.push_back(s);
    currents.push_back(c);
  }
  return calibrateMotors(standard, currents, BASE_SPEED);
}

namespace {

/// Whether a drive was measured in a cut along its own axis, as in the paper's longitudinal and facing cuts.
bool alone(const MotorCut& cut, std::size_t axis) {
  return cut.cut.range[axis] && cut.air.range[axis] && std::abs(cut.cut.velocity[1 - axis]) < 1e-9;
}

/// Error [N] of the product's method for a cut: force along an axis (0, 1) or tangential force (2). Empty:
/// refused, or not measured alone.
std::optional<double> errorBy(MotorMethod method, const MotorCut& cut, std::size_t which,
                              const MotorCalibration& calibration) {
  MotorParameters parameters = estimatorParameters().motor;
  parameters.method = method == MotorMethod::anfis ? "anfis" : "regression";
  if (which < 2 && !alone(cut, which)) return std::nullopt;
  const MotorForce found = forceFromMotors(cut.cut, {cut.air}, calibration, parameters);
  if (which == 2)
    return found.torque ? std::optional((found.torque->value - cut.torque) / cut.radius) : std::nullopt;
  return found.force[which] ? std::optional(found.force[which]->value - cut.force[which]) : std::nullopt;
}

void judgeEstimates(const std::vector<MotorCut>& cuts, DayErrors* errors) {
  double n = 0.0;
  for (const MotorCut& cut : cuts) n += cut.estimate.has_value();
  for (const MotorCut& cut : cuts) {
    if (!cut.estimate) continue;
    for (std::size_t a = 0; a < 3; ++a) {
      const Estimate &mean = cut.estimate->mean[a], &rms = cut.estimate->rms[a];
      errors->estimate[a] += std::pow(mean.value - cut.force[a], 2) / n;
      errors->inside[a] += (std::abs(mean.value - cut.force[a]) < 1.96 * mean.std_dev) / n;
      errors->inside_rms[a] += (std::abs(rms.value - cut.rms[a]) < 1.96 * rms.std_dev) / n;
    }
  }
  for (double& e : errors->estimate) e = std::sqrt(e);
  for (const MotorCut& cut : cuts) errors->windows += static_cast<int>(cut.windows.size());
  for (const MotorCut& cut : cuts) {
    for (const ForceEstimate& one : cut.windows) {
      for (std::size_t a = 0; a < 3; ++a) {
        const Estimate &mean = one.mean[a], &rms = one.rms[a];
        errors->window[a] += std::pow(mean.value - cut.force[a], 2) / errors->windows;
        errors->inside_window[a] += (std::abs(mean.value - cut.force[a]) < 1.96 * mean.std_dev) /
                                    static_cast<double>(errors->windows);
        errors->inside_window_rms[a] +=
            (std::abs(rms.value - cut.rms[a]) < 1.96 * rms.std_dev) / static_cast<double>(errors->windows);
      }
    }
  }
  for (double& e : errors->window) e = std::sqrt(e);
}

void judgeVariations(const std::vector<MotorCut>& cuts, DayErrors* errors) {
  for (DayErrors::Variation* all : {&errors->variation, &errors->variation_window}) {
    double count = 0.0;
    const auto add = [&](const ForceEstimate& one, const MotorCut& cut) {
      ++count;
      for (std::size_t a = 0; a < 3; ++a) {
        const double off = one.rms[a].value - cut.rms[a];
        all->error[a] += off * off;
        all->stated[a] += std::pow(one.rms[a].std_dev, 2);
        all->half[a] += std::abs(off) < 0.6745 * one.rms[a].std_dev;
      }
    };
    for (const MotorCut& cut : cuts) {
      if (all == &errors->variation && cut.estimate) add(*cut.estimate, cut);
      if (all == &errors->variation) continue;
      for (const ForceEstimate& one : cut.windows) add(one, cut);
    }
    for (std::size_t a = 0; a < 3; ++a) {
      all->error[a] = std::sqrt(all->error[a] / count);
      all->stated[a] = std::sqrt(all->stated[a] / count);
      all->half[a] /= count;
    }
  }
}

}  // namespace

DayErrors judgeDay(const std::vector<MotorCut>& learnt, const MotorCalibration& calibration,
                   const std::vector<MotorCut>& cuts) {
  DayErrors errors;
  for (std::size_t which = 0; which < 3; ++which) {
    // Air currents of the first day replace those of the second.
    double old_air = 0.0, old_count = 0.0;
    for (const MotorCut& cut : learnt) {
      if (which < 2 && cut.air.range[which]) old_air += *cut.air.range[which], old_count += 1.0;
    }
    old_air /= std::max(1.0, old_count);
    for (const MotorCut& cut : cuts) {
      const std::optional<double> by_law = errorBy(MotorMethod::regression, cut, which, calibration);
      if (!by_law) continue;
      ++errors.count[which];
      errors.regression[which] += *by_law * *by_law;
      double by_old = *by_law;
      if (which < 2) {
        const double against = cut.cut.velocity[which] > 0.0 ? -cut.force[which] : cut.force[which];
        by_old =
            calibration.drive[which]->newton_per_ampere.value * (*cut.cut.range[which] - old_air) - against;
      }
      errors.old_air[which] += by_old * by_old;
      const std::optional<double> by_anfis = errorBy(MotorMethod::anfis, cut, which, calibration);
      if (!by_anfis) continue;
      ++errors.anfis_count[which];
      errors.anfis[which] += *by_anfis * *by_anfis;
    }
    const double n = std::max(1, errors.count[which]);
    errors.regression[which] = std::sqrt(errors.regression[which] / n);
    errors.old_air[which] = std::sqrt(errors.old_air[which] / n);
    errors.anfis[which] = std::sqrt(errors.anfis[which] / std::max(1, errors.anfis_count[which]));
  }
  judgeEstimates(cuts, &errors);
  judgeVariations(cuts, &errors);
  return errors;
}

}  // namespace smartmill::loadmeter
