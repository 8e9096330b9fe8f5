#include "smartmill_loadmeter/identification/identification.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

constexpr int FEWEST_IN_WINDOW = 5;  // of the load meter

std::string countOf(std::size_t n, const char* what) {
  return std::to_string(n) + " " + what + (n == 1 ? "" : "s");
}

// Direction of the feed in the X-Y plane [rad].
double headingOf(const CuttingCondition& condition) {
  const auto& from = condition.steady_from;
  const auto& to = condition.steady_to;
  return std::atan2(to[1] - from[1], to[0] - from[0]);
}

/// Progress from one point to another along the steady path, times its length [m2].
double progressAlong(const CuttingCondition& condition, const std::array<double, 3>& a,
                     const std::array<double, 3>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i)
    sum += (b[i] - a[i]) * (condition.steady_to[i] - condition.steady_from[i]);
  return sum;
}

}  // namespace

void IdentificationParameters::validate() const {
  checkBounds(*this);
  motor.validate();
  checkBounds(force);
}

LoadMeterIdentification::LoadMeterIdentification(const MachineModel& model,
                                                 const IdentificationParameters& parameters)
    : file_(model.file),
      spindle_(model.needSpindle("read the load meter")),
      spindle_uncertainty_(model.uncertainty.spindle),
      parameters_(parameters),
      moves_(parameters.motor, model.axes) {
  parameters.validate();
  if (!spindle_.load_meter_full_scale) {
    throw Error(model.file + ": spindle.load_meter_full_scale_v is missing (required for the load meter)");
  }
}

void LoadMeterIdentification::reset() {
  condition_.reset();
  at_speed_since_.reset();
  on_path_since_.reset();
  last_load_ = last_state_ = next_window_ = 0.0;
  steady_.clear();
  path_first_.reset();
  path_last_.reset();
  air_cuts_.clear();
  cuts_.clear();
  rejected_tests_.clear();
  bad_data_.clear();
  production_.reset();
  moves_.clear();
  if (self_calibration_) self_calibration_->clear();
}

std::optional<MotorCalibration> LoadMeterIdentification::selfCalibration() const {
  return self_calibration_ ? self_calibration_->calibration() : std::nullopt;
}

bool LoadMeterIdentification::onPath(const CncState& state) const {
  return condition_ && state.connected && state.motion &&
         onSteadyPath(*condition_, state, parameters_.path_tolerance);
}

void LoadMeterIdentification::handle(const CncState& state) {
  const bool gap = state.stamp - last_state_ > parameters_.maximum_gap;
  last_state_ = state.stamp;
  moves_.handle(state);
  if (!condition_ || condition_->kind == CuttingCondition::Kind::none) return;
  // In air the tool may be at rest; if it moves, the feed drives show their friction.
  const bool on_path = onPath(state), is_cut = condition_->kind == CuttingCondition::Kind::cut;
  if (on_path_since_ && (!on_path || gap)) {
    steady_.dropAfter(state.stamp - parameters_.guard_time, is_cut);
    on_path_since_.reset();
  }
  if (!on_path) return;
  PathPoint point{state.stamp, {}};
  const std::array<const char*, 3> names{"X", "Y", "Z"};
  for (std::size_t a = 0; a < 3; ++a) {
    const auto axis = std::find(state.axes.begin(), state.axes.end(), names[a]);
    point.position[a] = state.position[static_cast<std::size_t>(axis - state.axes.begin())];
  }
  // The return to the start may run along the path, and the tool is at rest before the path.
  const bool entered = !on_path_since_;
  if (path_first_ && (progressAlong(*condition_, path_last_->position, point.position) < 0.0 ||
                      (entered && path_first_->stamp == path_last_->stamp)))
    path_first_.reset();
  if (!path_first_) {
    if (condition_->kind == CuttingCondition::Kind::cut) steady_.clear();
    path_first_ = point;
    on_path_since_ = state.stamp;
  }
  if (entered) on_path_since_ = state.stamp;
  path_last_ = point;
}

// Whether a block of another sensor belongs to the steady part of a test.
bool LoadMeterIdentification::isSteadyAt(double stamp) const {
  if (!condition_ || condition_->kind == CuttingCondition::Kind::none) return false;
  if (!at_speed_since_ || stamp - last_load_ > parameters_.maximum_gap) return false;
  double since = *at_speed_since_;
  // In air without motion only the spindle is measured.
  if (!on_path_since_ && (path_first_ || condition_->kind == CuttingCondition::Kind::cut)) return false;
  if (on_path_since_) since = std::max(since, *on_path_since_);
  return stamp >= since + parameters_.settle_time_constants * timeConstant(spindle_.load_meter_bandwidth);
}

void LoadMeterIdentification::handle(const SampleBlock& block) {
  if (!usesMotors()) return;
  if (!isServoRecord(block)) moves_.handle(block);
  if (isSteadyAt(block.stamp)) steady_.motor.add(block);
}

void LoadMeterIdentification::handle(const ForceBlock& block) {
  if (isSteadyAt(block.stamp)) steady_.force.add(block);
}

void LoadMeterIdentification::addMotorMeasurement(LoadTest* test, const MotorRecord& record,
                                                  bool is_short) const {
  if (!usesMotors() || record.empty()) return;
  std::array<double, 3> velocity{{0.0, 0.0, 0.0}};
  if (path_first_ && path_last_ && path_last_->stamp > path_first_->stamp) {
    for (std::size_t a = 0; a < 3; ++a) {
      velocity[a] =
          (path_last_->position[a] - path_first_->position[a]) / (path_last_->stamp - path_first_->stamp);
    }
  }
  const bool cut = test->condition.kind == CuttingCondition::Kind::cut;
  test->motor = measureMotors(record, parameters_.motor, velocity, test->speed, is_short,
                              cut ? test->condition.tool.teeth : 0);
  if (!cut) return;
  std::vector<MotorMeasurement> air;
  for (const LoadTest& one : air_cuts_) {
    if (one.motor) air.push_back(*one.motor);
  }
  if (self_calibration_) air = self_calibration_->airFor(*test->motor);
  const auto& calibration = motors_ ? motors_ : self_calibration_->calibration();
  if (!calibration) return;  // too few cuts so far
  test->force = forceFromMotors(*test->motor, air, *calibration, parameters_.motor);
  test->force->stamp = test->stamp;
  test->force->name = test->condition.name;
}

void LoadMeterIdentification::handle(const LoadSample& sample) {
  const bool gap = sample.stamp - last_load_ > parameters_.maximum_gap;
  last_load_ = sample.stamp;
  if (!condition_ || condition_->kind == CuttingCondition::Kind::none) return;
  if (!std::isfinite(sample.spindle_load) || !std::isfinite(sample.spindle_speed)) {
    if (bad_data_.empty()) {
      bad_data_ = formatted("test '%s': the load sample at %.3f s is not a finite number",
                            condition_->name.c_str(), sample.stamp);
    }
    return;
  }
  const bool steady = std::abs(sample.spindle_speed - condition_->spindle_speed) <=
                      parameters_.speed_tolerance * condition_->spindle_speed;
  if (at_speed_since_ && (!steady || gap)) {
    steady_.dropAfter(sample.stamp - parameters_.guard_time);
    at_speed_since_.reset();
  }
  if (!steady) return;
  if (!at_speed_since_) at_speed_since_ = sample.stamp;
  double since = *at_speed_since_;
  if (condition_->kind == CuttingCondition::Kind::cut) {
    if (!on_path_since_ || sample.stamp - last_state_ > parameters_.maximum_gap) return;
    since = std::max(since, *on_path_since_);
  }
  const double settle = parameters_.settle_time_constants * timeConstant(spindle_.load_meter_bandwidth);
  if (sample.stamp < since + settle) return;
  steady_.readings.push_back(
      {sample.stamp, sample.spindle_load * *spindle_.load_meter_full_scale, sample.spindle_speed});
  if (on_window_ && parameters_.force.period > 0.0 && condition_->kind == CuttingCondition::Kind::cut)
    estimateWindow(sample.stamp);
}

// Force over the last window of a steady cut.
void LoadMeterIdentification::estimateWindow(double now) {
  const double since = now - parameters_.force.window;
  if (now < next_window_ || steady_.readings.front().stamp > since) return;
  next_window_ = now + parameters_.force.period - 1e-6;
  LoadTest part = steadyTest(since);
  if (part.readings < FEWEST_IN_WINDOW) return;
  addMotorMeasurement(&part, steady_.motor.last(parameters_.force.window), true);
  part.sensor = steady_.force.measurement(since);
  if (const auto found = estimate(part)) on_window_(*found);
}

void LoadMeterIdentification::handle(const CuttingCondition& condition) {
  // A latched condition is received again when a subscriber reconnects.
  if (condition_ && condition_->stamp == condition.stamp && condition_->name == condition.name) return;
  closeTest();
  condition_ = condition;
  at_speed_since_.reset();
  on_path_since_.reset();
}

void LoadMeterIdentification::SteadyRecord::dropAfter(double stamp, bool with_readings) {
  while (with_readings && !readings.empty() && readings.back().stamp > stamp) readings.pop_back();
  motor.dropAfter(stamp);
  force.dropAfter(stamp);
}

void LoadMeterIdentification::SteadyRecord::clear(bool with_readings) {
  if (with_readings) readings.clear();
  motor.clear();
  force.clear();
}

void LoadMeterIdentification::closeTest() {
  if (condition_ && condition_->kind != CuttingCondition::Kind::none) {
    steady_.dropAfter(last_load_ - parameters_.guard_time);
    if (steady_.readings.size() < static_cast<std::size_t>(parameters_.minimum_readings)) {
      rejected_tests_.push_back("'" + condition_->name +
                                "': " + countOf(steady_.readings.size(), "steady reading") + ", expected " +
                                std::to_string(parameters_.minimum_readings) + " or more");
    } else {
      storeTest(steadyTest());
    }
  }
  steady_.clear();
  path_first_.reset();
  path_last_.reset();
}

LoadTest LoadMeterIdentification::steadyTest(double since) const {
  LoadTest test;
  test.condition = *condition_;
  const auto first = std::find_if(steady_.readings.begin(), steady_.readings.end(),
                                  [since](const SteadyRecord::Sample& r) { return r.stamp >= since; });
  const std::vector<SteadyRecord::Sample> steady(first, steady_.readings.end());
  test.readings = static_cast<int>(steady.size());
  if (test.readings < 2) return test;
  const double n = static_cast<double>(steady.size());
  for (const SteadyRecord::Sample& r : steady) {
    test.voltages.push_back(r.voltage);
    test.times.push_back(r.stamp - steady.front().stamp);
    test.speed += r.speed / n;
  }
  double speed2 = 0.0;
  for (const SteadyRecord::Sample& r : steady) speed2 += (r.speed - test.speed) * (r.speed - test.speed);
  test.speed_std = std::sqrt(speed2 / (n * (n - 1.0)));
  test.stamp = steady.back().stamp;
  test.duration = steady.back().stamp - steady.front().stamp;
  test.computeMean(spindle_, resolutionOf(test.voltages, spindle_.load_meter_resolution));
  return test;
}

void LoadMeterIdentification::storeTest(LoadTest test) {
  addMotorMeasurement(&test, steady_.motor, false);
  test.sensor = steady_.force.measurement();
  const bool cut = test.condition.kind == CuttingCondition::Kind::cut;
  (cut ? cuts_ : air_cuts_).push_back(test);
  if (cut) updateProduction(test);
  if (self_calibration_ && test.motor && !cut) self_calibration_->air(*test.motor, test.stamp);
  if (self_calibration_ && test.motor && cut) {
    if (const auto reference = estimate(test, true)) self_calibration_->cut(*test.motor, *reference);
  }
  if (on_test_) on_test_(test);
  if (on_motor_force_ && test.force) on_motor_force_(*test.force);
  if (!cut || !on_force_) return;
  if (const auto found = estimate(test)) on_force_(*found);
}

// Force from all measurements of a cut; a sensor's zero and noise are those of the last air cut.
std::optional<ForceEstimate> LoadMeterIdentification::estimate(const LoadTest& cut,
                                                               bool without_motors) const {
  CutMeasurements readings;
  readings.stamp = cut.stamp;
  readings.name = cut.condition.name;
  readings.tool = cut.condition.tool;
  readings.engagement = cut.condition.engagement;
  readings.heading = headingOf(cut.condition);
  readings.load_torque = cuttingTorqueOf(cut);
  readings.spindle_speed = cut.speed;
  if (cut.force && !without_motors) {
    readings.motor_lines = cut.force->lines;
    for (std::size_t a = 0; a < 3; ++a) readings.bandwidth[a] = moves_.bandwidth(a);
    readings.motor_torque = cut.force->torque;
    readings.motor_force = cut.force->force;
    readings.motor_other = cut.force->other;
  }
  if (cut.sensor) {
    std::optional<ForceMeasurement> air;
    for (const LoadTest& test : air_cuts_) {
      if (test.sensor) air = test.sensor;
    }
    for (std::size_t a = 0; a < 3; ++a) {
      readings.sensor_force[a] = cut.sensor->meanAbove(air, a);
      readings.sensor_rms[a] = cut.sensor->rmsAbove(air, a);
    }
  }
  try {
    ForceEstimate found = estimateForce(readings, parameters_.force);
    found.duration = cut.duration;
    return found;
  } catch (const Error&) {
    return std::nullopt;  // no measurement: friction is unknown, no motor, no sensor
  }
}

std::optional<Estimate> LoadMeterIdentification::cuttingTorqueOf(const LoadTest& cut) const {
  try {
    const IdleTorque idle = idleTorque(air_cuts_, spindle_, spindle_uncertainty_);
    const double watt = spindle_.load_meter_gain * cut.speed;
    const std::vector<double> gradient = idle.gradient(cut);
    double variance = std::pow(cut.torqueStdAsVoltage() / watt, 2);
    for (std::size_t i = 0; i < idle.unknowns; ++i) {
      for (std::size_t j = 0; j < idle.unknowns; ++j) {
        variance += gradient[i] * idle.covariance[i * idle.unknowns + j] * gradient[j];
      }
    }
    return Estimate{cut.voltage.mean / watt - idle.torque(cut), std::sqrt(variance)};
  } catch (const Error&) {
    return std::nullopt;  // a single air cut does not determine the friction
  }
}

void LoadMeterIdentification::updateProduction(const LoadTest& cut) {
  const std::optional<Estimate> torque = cuttingTorqueOf(cut);
  if (!torque) return;
  TorqueMeasurement measurement;
  measurement.torque = torque->value;
  measurement.torque_std = torque->std_dev;
  if (!(measurement.torque_std > 0.0)) return;
  const std::string of = cut.condition.tool_name + "\n" + cut.condition.material;
  if (!production_ || of != production_of_) {
    production_.emplace(RecursiveCoefficients::Start(), parameters_.production_memory);
    production_of_ = of;
  }
  measurement.tool = cut.condition.tool;
  measurement.engagement = cut.condition.engagement;
  measurement.cutting_time = cut.duration;
  production_->update(measurement);
  reportCut(cut);
}

void LoadMeterIdentification::reportCut(const LoadTest& cut) {
  const CuttingCondition& c = cut.condition;
  double& age = edge_age_[c.tool_name];
  age += cut.duration;
  if (!on_cut_) return;
  CoefficientRecord record;
  record.set.stamp = cut.stamp;
  record.set.tool = c.tool_name;
  record.set.material = c.material;
  record.set.source = SOURCE_PRODUCTION;
  record.set.tests = 1;
  record.set.value = record.set.std_dev = NOT_IDENTIFIED;
  const double alone = std::sqrt(static_cast<double>(production_->readings()));
  record.set.value.ktc = production_->ktc(), record.set.std_dev.ktc = alone * production_->ktcStd();
  record.set.value.kte = production_->kte(), record.set.std_dev.kte = alone * production_->kteStd();
  record.covariance[CoefficientRecord::covarianceIndex(0, 0)] = std::pow(record.set.std_dev.ktc, 2);
  record.covariance[CoefficientRecord::covarianceIndex(3, 3)] = std::pow(record.set.std_dev.kte, 2);
  record.covariance[CoefficientRecord::covarianceIndex(0, 3)] = alone * alone * production_->covariance();
  record.teeth = c.tool.teeth;
  record.diameter = c.tool.diameter;
  record.helix = c.tool.helix;
  record.cutting_speed = 0.5 * c.tool.diameter * cut.speed;
  record.feed_per_tooth = c.engagement.feed_per_tooth;
  record.axial_depth = c.engagement.axial_depth;
  record.entry = c.engagement.entry;
  record.exit = c.engagement.exit;
  record.edge_age = age;
  on_cut_(record);
}

void LoadMeterIdentification::handle(const IdentifyGoal& goal) {
  if (goal.reset) {
    // The present condition remains: its test starts again.
    steady_.clear();
    air_cuts_.clear();
    cuts_.clear();
    if (self_calibration_) self_calibration_->clear();
    rejected_tests_.clear();
    bad_data_.clear();
    IdentifyResult result;
    result.reset = true;
    result.id = goal.id;
    result.message = "earlier tests discarded";
    result.coefficients.stamp = goal.stamp;
    result.coefficients.value = result.coefficients.std_dev = NOT_IDENTIFIED;
    if (on_result_) on_result_(result);
    return;
  }
  closeTest();
  condition_.reset();
  if (on_result_) on_result_(identify(goal));
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
  SessionResult found;
  std::string aside;
  if (cuts.size() < cuts_.size()) {
    aside += "; " + countOf(cuts_.size() - cuts.size(), "cut") + " with another tool or material ignored";
  }
  for (const std::string& reason : rejected_tests_) aside += "; " + reason;
  try {
    found = identifyFromTests(air_cuts_, cuts, spindle_, spindle_uncertainty_, parameters_.largest_runout);
  } catch (const Error& error) {
    result.code = IdentifyResult::Code::too_few_tests;
    result.message = error.what() + aside;
    return result;
  }
  result.record = found.record;
  aside = found.found + addMotorCoefficients(cuts, &result.record) + aside;
  CoefficientSet& k = result.record.set;
  if (!goal.tool.empty()) k.tool = goal.tool;
  if (!goal.material.empty()) k.material = goal.material;
  result.coefficients = k;
  result.message = formatted("Ktc %.1f +- %.1f N/mm2, Kte %.2f +- %.2f N/mm from %zu air cuts and %zu cuts",
                             k.value.ktc / units::N_PER_MM2, k.std_dev.ktc / units::N_PER_MM2,
                             k.value.kte / units::N_PER_MM, k.std_dev.kte / units::N_PER_MM, air_cuts_.size(),
                             cuts.size()) +
                   aside + selfCalibrationText();
  return result;
}

std::string LoadMeterIdentification::selfCalibrationText() const {
  if (!usesMotors()) return "";
  const std::array<std::optional<Estimate>, 3> bandwidth{moves_.bandwidth(0), moves_.bandwidth(1),
                                                         moves_.bandwidth(2)};
  const std::string text = self_calibration_.value_or(SelfCalibration(parameters_.motor)).text(bandwidth);
  return text.empty() ? "; motors: not calibrated yet" : "; motors: " + text;
}

// Adds radial and axial coefficients; Ktc and Kte remain those of the torque, which account for the common
// friction. @return text for the message.
std::string LoadMeterIdentification::addMotorCoefficients(const std::vector<LoadTest>& cuts,
                                                          CoefficientRecord* record) const {
  std::vector<JointMeasurement> readings;
  bool any = false;
  const IdleTorque idle = idleTorque(air_cuts_, spindle_, spindle_uncertainty_);
  for (const LoadTest& cut : cuts) {
    JointMeasurement r;
    r.tool = cut.condition.tool;
    r.engagement = cut.condition.engagement;
    r.heading = headingOf(cut.condition);
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
  return text.empty() ? "; all six coefficients observable with motor currents"
                      : "; not observable from the axes that moved: " + text;
}

}  // namespace smartmill::loadmeter
