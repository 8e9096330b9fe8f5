#include "smartmill_loadmeter/identification/identification.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "smartmill_core/cutting/regression.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/friction_law.h"

namespace smartmill::loadmeter {

namespace {

void require(bool good, const char* key, double value, const char* due) {
  if (good) return;
  char text[160];
  std::snprintf(text, sizeof text, "%s: %g is out of range (%s)", key, value, due);
  throw Error(text);
}

// Step of the readings: the model's resolution, or a coarser one that the readings show (a controller may
// round again).
double stepOf(const std::vector<double>& readings, double resolution) {
  std::vector<double> sorted = readings;
  std::sort(sorted.begin(), sorted.end());
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    const double difference = sorted[i] - sorted[i - 1];
    if (difference > 1e-9 * std::abs(sorted[i])) smallest = std::min(smallest, difference);
  }
  return std::isfinite(smallest) ? std::max(smallest, resolution) : resolution;
}

std::string countOf(std::size_t n, const char* what) {
  return std::to_string(n) + " " + what + (n == 1 ? "" : "s");
}

}  // namespace

void IdentificationParameters::validate() const {
  require(speed_tolerance > 0.0 && speed_tolerance < 0.5, "speed_tolerance", speed_tolerance,
          "0 < value < 0.5");
  require(settle_time_constants >= 5.0 && settle_time_constants <= 1000.0, "settle_time_constants",
          settle_time_constants, "5 <= value <= 1000");
  require(guard_time >= 0.0 && guard_time <= 10.0, "guard_time", guard_time, "0 <= value <= 10");
  require(path_tolerance > 0.0 && path_tolerance <= 1.0, "path_tolerance", path_tolerance, "0 < value <= 1");
  require(minimum_readings >= 2, "minimum_readings", minimum_readings, ">= 2");
  require(production_memory > 0.0 && production_memory <= 1e7, "production_memory", production_memory,
          "0 < value <= 1e7");
  motor.validate();
  require(maximum_gap > 0.0 && maximum_gap <= 60.0, "maximum_gap", maximum_gap, "0 < value <= 60");
}

LoadMeterIdentification::LoadMeterIdentification(const MachineModel& model,
                                                 const IdentificationParameters& parameters)
    : file_(model.file),
      spindle_(model.needSpindle("read the load meter")),
      spindle_uncertainty_(model.uncertainty.spindle),
      parameters_(parameters) {
  parameters.validate();
  if (!spindle_.load_meter_full_scale) {
    throw Error(model.file + ": spindle.load_meter_full_scale_v is missing (needed to read the load meter)");
  }
}

void LoadMeterIdentification::reset() {
  condition_.reset();
  speed_since_.reset();
  path_since_.reset();
  last_reading_ = last_state_ = 0.0;
  readings_.clear();
  motor_record_.clear();
  path_first_.reset();
  path_last_.reset();
  air_cuts_.clear();
  cuts_.clear();
  dropped_.clear();
  bad_data_.clear();
  production_.reset();
}

bool LoadMeterIdentification::onPath(const CncState& state) const {
  if (!condition_ || !state.connected || !state.motion) return false;
  const std::array<const char*, 3> names{"X", "Y", "Z"};
  double length2 = 0.0, along = 0.0, distance2 = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto axis = std::find(state.axes.begin(), state.axes.end(), names[a]);
    const auto index = static_cast<std::size_t>(axis - state.axes.begin());
    if (index >= state.position.size()) return false;
    const double step = condition_->steady_to[a] - condition_->steady_from[a];
    const double at = state.position[index] - condition_->steady_from[a];
    length2 += step * step;
    along += step * at;
    distance2 += at * at;
  }
  if (!(length2 > 0.0) || along < 0.0 || along > length2) return false;
  return distance2 - along * along / length2 <= parameters_.path_tolerance * parameters_.path_tolerance;
}

void LoadMeterIdentification::handle(const CncState& state) {
  const bool gap = state.stamp - last_state_ > parameters_.maximum_gap;
  last_state_ = state.stamp;
  if (!condition_ || condition_->kind == CuttingCondition::Kind::none) return;
  // In air the tool need not move; where it does the feed drives show their friction.
  const bool on_path = onPath(state);
  if (path_since_ && (!on_path || gap)) {
    if (condition_->kind == CuttingCondition::Kind::cut) dropAfter(state.stamp - parameters_.guard_time);
    motor_record_.dropAfter(state.stamp - parameters_.guard_time);
    path_since_.reset();
  }
  if (!on_path) return;
  if (!path_since_) {
    path_since_ = state.stamp;
    if (!path_first_) motor_record_.clear();  // standing still before it
  }
  PathPoint point{state.stamp, {}};
  const std::array<const char*, 3> names{"X", "Y", "Z"};
  for (std::size_t a = 0; a < 3; ++a) {
    const auto axis = std::find(state.axes.begin(), state.axes.end(), names[a]);
    point.position[a] = state.position[static_cast<std::size_t>(axis - state.axes.begin())];
  }
  if (!path_first_) path_first_ = point;
  path_last_ = point;
}

void LoadMeterIdentification::handle(const SampleBlock& block) {
  if (!motors_ || !condition_ || condition_->kind == CuttingCondition::Kind::none) return;
  if (!speed_since_ || block.stamp - last_reading_ > parameters_.maximum_gap) return;
  double since = *speed_since_;
  // In air without motion the spindle alone is read.
  if (!path_since_ && (path_first_ || condition_->kind == CuttingCondition::Kind::cut)) return;
  if (path_since_) since = std::max(since, *path_since_);
  if (block.stamp < since + parameters_.settle_time_constants * timeConstant(spindle_.load_meter_bandwidth)) {
    return;
  }
  motor_record_.add(block);
}

void LoadMeterIdentification::readMotorsOf(LoadTest* test) {
  if (!motors_ || motor_record_.empty()) return;
  std::array<double, 3> velocity{{0.0, 0.0, 0.0}};
  if (path_first_ && path_last_ && path_last_->stamp > path_first_->stamp) {
    for (std::size_t a = 0; a < 3; ++a) {
      velocity[a] =
          (path_last_->position[a] - path_first_->position[a]) / (path_last_->stamp - path_first_->stamp);
    }
  }
  test->motor = readMotors(motor_record_, parameters_.motor, velocity, test->speed);
  if (test->condition.kind != CuttingCondition::Kind::cut) return;
  std::vector<MotorReading> air;
  for (const LoadTest& one : air_cuts_) {
    if (one.motor) air.push_back(*one.motor);
  }
  test->force = forceFromMotors(*test->motor, air, *motors_, parameters_.motor);
  test->force->stamp = test->stamp;
  test->force->name = test->condition.name;
}

void LoadMeterIdentification::handle(const LoadSample& sample) {
  const bool gap = sample.stamp - last_reading_ > parameters_.maximum_gap;
  last_reading_ = sample.stamp;
  if (!condition_ || condition_->kind == CuttingCondition::Kind::none) return;
  if (!std::isfinite(sample.spindle_load) || !std::isfinite(sample.spindle_speed)) {
    if (bad_data_.empty()) {
      char text[200];
      std::snprintf(text, sizeof text, "test '%s': the load sample at %.3f s is not a finite number",
                    condition_->name.c_str(), sample.stamp);
      bad_data_ = text;
    }
    return;
  }
  const bool steady = std::abs(sample.spindle_speed - condition_->spindle_speed) <=
                      parameters_.speed_tolerance * condition_->spindle_speed;
  if (speed_since_ && (!steady || gap)) {
    dropAfter(sample.stamp - parameters_.guard_time);
    motor_record_.dropAfter(sample.stamp - parameters_.guard_time);
    speed_since_.reset();
  }
  if (!steady) return;
  if (!speed_since_) speed_since_ = sample.stamp;
  double since = *speed_since_;
  if (condition_->kind == CuttingCondition::Kind::cut) {
    if (!path_since_ || sample.stamp - last_state_ > parameters_.maximum_gap) return;
    since = std::max(since, *path_since_);
  }
  const double settle = parameters_.settle_time_constants * timeConstant(spindle_.load_meter_bandwidth);
  if (sample.stamp < since + settle) return;
  readings_.push_back(
      {sample.stamp, sample.spindle_load * *spindle_.load_meter_full_scale, sample.spindle_speed});
}

void LoadMeterIdentification::handle(const CuttingCondition& condition) {
  // A latched condition comes again when a subscriber connects anew.
  if (condition_ && condition_->stamp == condition.stamp && condition_->name == condition.name) return;
  closeTest();
  condition_ = condition;
  speed_since_.reset();
  path_since_.reset();
}

void LoadMeterIdentification::dropAfter(double stamp) {
  while (!readings_.empty() && readings_.back().stamp > stamp) readings_.pop_back();
}

void LoadMeterIdentification::closeTest() {
  if (condition_ && condition_->kind != CuttingCondition::Kind::none) {
    dropAfter(last_reading_ - parameters_.guard_time);
    motor_record_.dropAfter(last_reading_ - parameters_.guard_time);
    const std::size_t n = readings_.size();
    if (n < static_cast<std::size_t>(parameters_.minimum_readings)) {
      dropped_.push_back("'" + condition_->name + "' has " + countOf(n, "steady reading") + ", " +
                         std::to_string(parameters_.minimum_readings) + " are due");
    } else {
      LoadTest test;
      test.condition = *condition_;
      std::vector<double> voltages;
      for (const Reading& r : readings_) {
        voltages.push_back(r.voltage);
        test.speed += r.speed / static_cast<double>(n);
      }
      double speed2 = 0.0;
      for (const Reading& r : readings_) speed2 += (r.speed - test.speed) * (r.speed - test.speed);
      test.speed_std = std::sqrt(speed2 / static_cast<double>(n * (n - 1)));
      const double interval = (readings_.back().stamp - readings_.front().stamp) / static_cast<double>(n - 1);
      test.voltage = meanVoltage(voltages, interval, timeConstant(spindle_.load_meter_bandwidth),
                                 stepOf(voltages, spindle_.load_meter_resolution));
      test.readings = static_cast<int>(n);
      test.stamp = readings_.back().stamp;
      test.duration = readings_.back().stamp - readings_.front().stamp;
      readMotorsOf(&test);
      (condition_->kind == CuttingCondition::Kind::air ? air_cuts_ : cuts_).push_back(test);
      if (condition_->kind == CuttingCondition::Kind::cut) follow(test);
      if (test_) test_(test);
      if (motor_force_ && test.force) motor_force_(*test.force);
    }
  }
  readings_.clear();
  motor_record_.clear();
  path_first_.reset();
  path_last_.reset();
}

void LoadMeterIdentification::follow(const LoadTest& cut) {
  TorqueReading reading;
  try {
    const IdleTorque idle = idleTorque(air_cuts_, spindle_, spindle_uncertainty_);
    const double watt = spindle_.load_meter_gain * cut.speed;
    reading.torque = cut.voltage.mean / watt - idle.torque(cut);
    const std::vector<double> gradient = idle.gradient(cut);
    double variance = std::pow(cut.torqueStdAsVoltage() / watt, 2);
    for (std::size_t i = 0; i < idle.unknowns; ++i) {
      for (std::size_t j = 0; j < idle.unknowns; ++j) {
        variance += gradient[i] * idle.covariance[i * idle.unknowns + j] * gradient[j];
      }
    }
    reading.torque_std = std::sqrt(variance);
  } catch (const Error&) {
    return;  // one air cut so far: the friction is not known yet
  }
  if (!(reading.torque_std > 0.0)) return;
  const std::string of = cut.condition.tool_name + "\n" + cut.condition.material;
  if (!production_ || of != production_of_) {
    production_.emplace(RecursiveCoefficients::Start(), parameters_.production_memory);
    production_of_ = of;
  }
  reading.tool = cut.condition.tool;
  reading.engagement = cut.condition.engagement;
  reading.cutting_time = cut.duration;
  production_->update(reading);
}

void LoadMeterIdentification::handle(const IdentifyGoal& goal) {
  if (goal.reset) {
    // The condition that holds stays: its test begins anew.
    readings_.clear();
    motor_record_.clear();
    air_cuts_.clear();
    cuts_.clear();
    dropped_.clear();
    bad_data_.clear();
    IdentifyResult result;
    result.reset = true;
    result.id = goal.id;
    result.message = "earlier tests are forgotten";
    result.coefficients.stamp = goal.stamp;
    result.coefficients.value = result.coefficients.std_dev = NOT_IDENTIFIED;
    if (result_) result_(result);
    return;
  }
  closeTest();
  condition_.reset();
  if (result_) result_(identify(goal));
}

IdentifyResult LoadMeterIdentification::identify(const IdentifyGoal& goal) const {
  IdentifyResult result;
  result.id = goal.id;
  result.coefficients.value = result.coefficients.std_dev = NOT_IDENTIFIED;
  result.coefficients.stamp = goal.stamp;
  if (!bad_data_.empty()) {
    result.code = IdentifyResult::Code::bad_data;
    result.message = bad_data_;
    return result;
  }
  std::vector<LoadTest> cuts;
  for (const LoadTest& test : cuts_) {
    if ((goal.tool.empty() || test.condition.tool_name == goal.tool) &&
        (goal.material.empty() || test.condition.material == goal.material)) {
      cuts.push_back(test);
    }
  }
  std::string aside;
  if (cuts.size() < cuts_.size()) {
    aside += "; " + countOf(cuts_.size() - cuts.size(), "cut") + " with another tool or material left out";
  }
  for (const std::string& reason : dropped_) aside += "; " + reason;
  try {
    result.record = identifyFromTests(air_cuts_, cuts, spindle_, spindle_uncertainty_);
  } catch (const Error& error) {
    result.code = IdentifyResult::Code::too_few_tests;
    result.message = error.what() + aside;
    return result;
  }
  aside = addFromMotors(cuts, &result.record) + aside;
  CoefficientSet& k = result.record.set;
  if (!goal.tool.empty()) k.tool = goal.tool;
  if (!goal.material.empty()) k.material = goal.material;
  result.coefficients = k;
  char text[200];
  std::snprintf(
      text, sizeof text, "Ktc %.1f +- %.1f N/mm2, Kte %.2f +- %.2f N/mm from %zu air cuts and %zu cuts",
      k.value.ktc / units::N_PER_MM2, k.std_dev.ktc / units::N_PER_MM2, k.value.kte / units::N_PER_MM,
      k.std_dev.kte / units::N_PER_MM, air_cuts_.size(), cuts.size());
  result.message = text + aside;
  return result;
}

// Radial and axial coefficients; Ktc and Kte stay those of the torque, which know the friction they share.
// @return what to add to the message.
std::string LoadMeterIdentification::addFromMotors(const std::vector<LoadTest>& cuts,
                                                   CoefficientRecord* record) const {
  std::vector<JointReading> readings;
  bool any = false;
  const IdleTorque idle = idleTorque(air_cuts_, spindle_, spindle_uncertainty_);
  for (const LoadTest& cut : cuts) {
    JointReading r;
    r.tool = cut.condition.tool;
    r.engagement = cut.condition.engagement;
    const auto& from = cut.condition.steady_from;
    const auto& to = cut.condition.steady_to;
    r.heading = std::atan2(to[1] - from[1], to[0] - from[0]);
    const double watt = spindle_.load_meter_gain * cut.speed;
    const Estimate torque{cut.voltage.mean / watt - idle.torque(cut), cut.torqueStdAsVoltage() / watt};
    if (torque.std_dev > 0.0) r.torque = torque;
    if (cut.force) r.axis_force = cut.force->force;
    for (const auto& force : r.axis_force) any = any || force;
    readings.push_back(r);
  }
  if (!any) return "";
  JointResult joint;
  try {
    joint = identifyJointly(readings);
  } catch (const Error& error) {
    return std::string("; motor currents: ") + error.what();
  }
  std::string text;
  for (std::size_t i = 0; i < cuttingKeys().size(); ++i) {
    if (i == 0 || i == 3) continue;
    const auto coefficient = cuttingKeys()[i].coefficient;
    record->set.value.*coefficient = joint.value.*coefficient;
    record->set.std_dev.*coefficient = joint.std_dev.*coefficient;
    for (std::size_t j = 0; j < cuttingKeys().size(); ++j) {
      const double c = joint.covariance[6 * i + j];
      if (std::isfinite(c)) {
        record->covariance[CoefficientRecord::covarianceIndex(std::min(i, j), std::max(i, j))] = c;
      }
    }
  }
  for (const std::string& name : joint.not_observable) text += (text.empty() ? "" : ", ") + name;
  record->set.source = "load_meter and motor_current";
  return text.empty() ? "; motor currents give all six"
                      : "; not observable from the axes that moved: " + text;
}

// T = V / (K omega): the shares of both add up.
double LoadTest::torqueStdAsVoltage() const {
  return std::hypot(voltage.std_dev, voltage.mean * speed_std / speed);
}

IdleTorque idleTorque(const std::vector<LoadTest>& air_cuts, const Spindle& spindle,
                      double spindle_uncertainty_percent) {
  IdleTorque idle;
  Friction friction = modelFriction(spindle, spindle_uncertainty_percent);
  if (!air_cuts.empty()) {
    std::vector<AirCut> air;
    std::vector<TimedAirCut> timed;
    double first = air_cuts.front().stamp;
    for (const LoadTest& test : air_cuts) first = std::min(first, test.stamp);
    bool weighted = true;
    for (const LoadTest& test : air_cuts) {
      air.push_back({test.speed, test.voltage.mean, test.torqueStdAsVoltage()});
      timed.push_back({air.back(), test.stamp - first});
      weighted = weighted && air.back().voltage_std > 0.0;
    }
    friction = fitFriction(air, spindle.load_meter_gain, spindle.friction_zero_below);
    idle.viscous = friction.viscous;
    idle.coulomb = friction.coulomb;
    if (weighted && air.size() > FrictionShape{true, false}.unknowns()) {
      const FittedFriction best =
          fitFrictionLaws(timed, spindle.load_meter_gain, spindle.friction_zero_below).front();
      if (best.shape.unknowns() > 2) {
        idle.viscous = best.law.viscous;
        idle.coulomb = best.law.coulomb;
        idle.unknowns = best.shape.unknowns();
        idle.covariance = best.covariance;
        idle.torque = [best, first](const LoadTest& t) { return best.law.torque(t.speed, t.stamp - first); };
        idle.gradient = [best, first](const LoadTest& t) {
          std::vector<double> slope;
          for (std::size_t i = 0; i < best.value.size(); ++i) {
            std::vector<double> v = best.value;
            const double step = 1e-5 * (std::abs(v[i]) + 1e-6);
            const auto at = [&](double value) {
              v[i] = value;
              return FrictionLaw::fromValues(best.shape, v.data(), best.law.zero_below)
                  .torque(t.speed, t.stamp - first);
            };
            slope.push_back((at(best.value[i] + step) - at(best.value[i] - step)) / (2.0 * step));
          }
          return slope;
        };
        return idle;
      }
    }
  }
  idle.unknowns = 2;
  idle.covariance.assign(friction.covariance.begin(), friction.covariance.end());
  idle.torque = [friction](const LoadTest& t) { return friction.torque(t.speed); };
  idle.gradient = [friction](const LoadTest& t) {
    const std::array<double, 2> g = friction.gradient(t.speed);
    return std::vector<double>{g[0], g[1]};
  };
  return idle;
}

CoefficientRecord identifyFromTests(const std::vector<LoadTest>& air_cuts, const std::vector<LoadTest>& cuts,
                                    const Spindle& spindle, double spindle_uncertainty_percent) {
  CoefficientRecord record;
  CoefficientSet& result = record.set;
  const IdleTorque idle = idleTorque(air_cuts, spindle, spindle_uncertainty_percent);
  result.friction_viscous = idle.viscous;
  result.friction_coulomb = idle.coulomb;
  const std::size_t n = idle.unknowns;
  std::vector<MeanTorqueTest> torques;
  std::vector<std::vector<MeanTorqueTest>> by_friction(
      n);  // torque that one unit of each friction term takes
  for (const LoadTest& test : cuts) {
    MeanTorqueTest t;
    t.tool = test.condition.tool;
    t.engagement = test.condition.engagement;
    t.torque = test.voltage.mean / (spindle.load_meter_gain * test.speed) - idle.torque(test);
    t.torque_std = test.torqueStdAsVoltage() / (spindle.load_meter_gain * test.speed);
    torques.push_back(t);
    const std::vector<double> gradient = idle.gradient(test);
    for (std::size_t i = 0; i < n; ++i) {
      t.torque = -gradient[i];
      by_friction[i].push_back(t);
    }
    result.stamp = std::max(result.stamp, test.stamp);
    result.tool = test.condition.tool_name;
    result.material = test.condition.material;
  }
  const IdentifiedCoefficients found = identifyFromTorque(torques);
  result.value = found.value;
  result.std_dev = found.std_dev;
  // The estimate is linear in the torques: the regression of a friction term's torque is how the coefficients
  // follow it.
  std::vector<CuttingCoefficients> per_unit;
  for (const auto& tests : by_friction) per_unit.push_back(identifyFromTorque(tests).value);
  const auto shared = [&](double CuttingCoefficients::*a, double CuttingCoefficients::*b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j)
        sum += per_unit[i].*a * idle.covariance[i * n + j] * (per_unit[j].*b);
    }
    return sum;
  };
  const auto covariance = [&](std::size_t i, std::size_t j) -> double& {
    return record.covariance[CoefficientRecord::covarianceIndex(i, j)];
  };
  constexpr auto KTC = &CuttingCoefficients::ktc, KTE = &CuttingCoefficients::kte;
  covariance(0, 0) = found.covariance(0, 0) + shared(KTC, KTC);
  covariance(0, 3) = found.covariance(0, 3) + shared(KTC, KTE);
  covariance(3, 3) = found.covariance(3, 3) + shared(KTE, KTE);
  result.std_dev.ktc = std::sqrt(covariance(0, 0));
  result.std_dev.kte = std::sqrt(covariance(3, 3));
  result.source = "load_meter";
  result.tests = static_cast<int>(cuts.size());
  // Means of what was tried; the database measures distances from them.
  const CuttingCondition& first = cuts.front().condition;
  record.teeth = first.tool.teeth;
  record.diameter = first.tool.diameter;
  record.helix = first.tool.helix;
  record.cutting_speed = record.feed_per_tooth = record.axial_depth = record.entry = record.exit = 0.0;
  const double share = 1.0 / static_cast<double>(cuts.size());
  for (const LoadTest& test : cuts) {
    const Engagement& e = test.condition.engagement;
    record.cutting_speed += share * test.speed * test.condition.tool.radius();
    record.feed_per_tooth += share * e.feed_per_tooth;
    record.axial_depth += share * e.axial_depth;
    record.entry += share * e.entry;
    record.exit += share * e.exit;
  }
  return record;
}

}  // namespace smartmill::loadmeter
