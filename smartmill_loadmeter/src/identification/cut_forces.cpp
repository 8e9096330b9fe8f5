#include "smartmill_loadmeter/identification/cut_forces.h"

#include <array>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/steady_path.h"

namespace smartmill::loadmeter {

CutForces::CutForces(const MotorParameters& motor, const ForceEstimateParameters& force,
                     const std::optional<MachineAxes>& axes)
    : motor_parameters_(motor), force_parameters_(force), moves_(motor, axes) {
}

void CutForces::handle(const SampleBlock& block) {
  if (!isServoRecord(block)) moves_.handle(block);
}

void CutForces::addMotors(const MotorRecord& record, const std::array<double, 3>& velocity, bool is_short,
                          const std::vector<LoadTest>& air_cuts, LoadTest* test) const {
  if (!usesMotors() || record.empty()) return;
  test->motor = measureMotors(record, motor_parameters_, velocity, test->speed, is_short,
                              test->isCut() ? test->condition.tool.teeth : 0);
  if (!test->isCut()) return;
  std::vector<MotorMeasurement> air;
  for (const LoadTest& one : air_cuts) {
    if (one.motor) air.push_back(*one.motor);
  }
  if (self_calibration_) air = self_calibration_->airFor(*test->motor);
  const auto& calibration = motors_ ? motors_ : self_calibration_->calibration();
  if (!calibration) return;  // too few cuts so far
  test->force = forceFromMotors(*test->motor, air, *calibration, motor_parameters_);
  if (calibration->hasAnfis()) {
    const MotorParameters other = motor_parameters_.withOtherMethod();
    test->force->by_other_method =
        "by " + other.method + " " + forceFromMotors(*test->motor, air, *calibration, other).text();
  }
  test->force->stamp = test->stamp;
  test->force->name = test->condition.name;
}

namespace {

/// Of the last air cut: the zero of the sensor.
std::optional<ForceMeasurement> sensorInAir(const std::vector<LoadTest>& air_cuts) {
  std::optional<ForceMeasurement> air;
  for (const LoadTest& test : air_cuts)
    if (test.sensor) air = test.sensor;
  return air;
}

}  // namespace

MeanForce CutForces::meanForce(const LoadTest& cut, const std::vector<LoadTest>& air_cuts) const {
  MeanForce mean;
  if (feedTurns(cut.condition)) return mean;
  if (cut.sensor) {
    const std::optional<ForceMeasurement> air = sensorInAir(air_cuts);
    mean.gain_error = force_parameters_.sensor_error;
    for (std::size_t a = 0; a < 3; ++a) {
      const Estimate force = cut.sensor->meanAbove(air, a);
      mean.axis[a] = {force.value, std::hypot(force.std_dev, force_parameters_.sensor_zero)};
    }
  } else if (cut.force) {
    mean.axis = cut.force->force;
    mean.gain_error = force_parameters_.motor_error;
  }
  return mean;
}

std::optional<ForceEstimate> CutForces::estimate(const LoadTest& cut, const std::optional<Estimate>& torque,
                                                 const std::vector<LoadTest>& air_cuts,
                                                 bool without_motors) const {
  if (feedTurns(cut.condition)) return std::nullopt;
  CutMeasurements readings;
  readings.stamp = cut.stamp;
  readings.name = cut.condition.name;
  readings.tool = cut.condition.tool;
  readings.engagement = cut.condition.engagement;
  readings.heading = headingOf(cut.condition);
  readings.load_torque = torque;
  readings.spindle_speed = cut.speed;
  if (cut.force && !without_motors) {
    readings.motor_lines = cut.force->lines;
    for (std::size_t a = 0; a < 3; ++a) readings.bandwidth[a] = moves_.bandwidth(a);
    readings.motor_torque = cut.force->torque;
    readings.motor_force = cut.force->force;
    readings.motor_other = cut.force->other;
  }
  if (cut.sensor) {
    const std::optional<ForceMeasurement> air = sensorInAir(air_cuts);
    for (std::size_t a = 0; a < 3; ++a) {
      readings.sensor_force[a] = cut.sensor->meanAbove(air, a);
      readings.sensor_rms[a] = cut.sensor->rmsAbove(air, a);
    }
  }
  try {
    ForceEstimate found = estimateForce(readings, force_parameters_);
    found.duration = cut.duration;
    return found;
  } catch (const Error&) {
    return std::nullopt;  // no measurement: friction is unknown, no motor, no sensor
  }
}

void CutForces::calibrate(const LoadTest& test, const std::optional<Estimate>& torque,
                          const std::vector<LoadTest>& air_cuts) {
  if (!self_calibration_ || !test.motor) return;
  if (!test.isCut()) return self_calibration_->air(*test.motor, test.stamp);
  if (const auto reference = estimate(test, torque, air_cuts, true))
    self_calibration_->cut(*test.motor, *reference);
}

std::optional<MotorCalibration> CutForces::selfCalibration() const {
  return self_calibration_ ? self_calibration_->calibration() : std::nullopt;
}

std::string CutForces::calibrationText() const {
  if (!usesMotors()) return "";
  const std::array<std::optional<Estimate>, 3> bandwidth{moves_.bandwidth(0), moves_.bandwidth(1),
                                                         moves_.bandwidth(2)};
  const std::string text = self_calibration_.value_or(SelfCalibration(motor_parameters_)).text(bandwidth);
  return text.empty() ? "; motors: not calibrated yet" : "; motors: " + text;
}

void CutForces::clearCalibration() {
  if (self_calibration_) self_calibration_->clear();
}

void CutForces::clear() {
  moves_.clear();
  clearCalibration();
}

}  // namespace smartmill::loadmeter
