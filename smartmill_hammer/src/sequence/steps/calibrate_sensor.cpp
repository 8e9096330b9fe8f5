#include <utility>

#include "sequence/steps/steps.h"
#include "smartmill_core/formatted.h"
#include "smartmill_hammer/search/sensor_calibration.h"

namespace smartmill::hammer {
namespace {

/// Jogs the tool towards a sensor until its voltage is about zero and measures its sensitivity there. The
/// measured voltages also extend what is known of the flanks, by which the approach is limited.
class CalibrateSensor : public SequenceStep {
 public:
  using SequenceStep::SequenceStep;

  StepOutcome begin(double now) override {
    control_.selectSensor(usesCrossSensor());
    return measureVoltageAfter(now, startDelay());
  }

  StepOutcome motionDone(double now) override {
    return measureVoltageAfter(now, measurement_.parameters.settle_time);
  }

  StepOutcome voltageMeasured(double now, const MeanVoltage& voltage) override {
    if (!calibration_) {
      start(voltage);
    } else {
      update(voltage);
    }
    switch (calibration_->state()) {
      case SensorCalibration::State::jogging:
        control_.jog(now, axis(), calibration_->nextJog(), measurement_.parameters.jog_feed);
        return StepOutcome::running();
      case SensorCalibration::State::failed:
        control_.selectSensor(false);
        return calibrationFailed(calibration_->reason());
      case SensorCalibration::State::done:
        break;
    }
    control_.selectSensor(false);
    storeSensor();
    return StepOutcome::done();
  }

 protected:
  virtual double startDelay() const { return measurement_.parameters.settle_time; }
  virtual bool usesCrossSensor() const { return false; }
  /// Whether the flanks change with what this calibration measures.
  virtual bool updatesFlanks() const { return true; }
  /// Called with the first voltage.
  virtual void startVoltage(double /*volt*/) {}
  virtual SensorState& sensor() { return measurement_.first.sensor; }
  virtual double endProgress() const = 0;
  virtual StepOutcome calibrationFailed(const std::string& reason) {
    return StepOutcome::failed(FrfCode::bad_data, "sensor calibration: " + reason);
  }

 private:
  std::size_t axis() const {
    return usesCrossSensor() ? measurement_.paths.across() : measurement_.paths.along();
  }
  void addToFlanks(double volt) {
    if (updatesFlanks())
      measurement_.approach.addMeasurement(measurement_.rotationFromFlute(axis()), volt, moved(axis()),
                                           !usesCrossSensor());
  }
  double safeTravel() const { return measurement_.safeTravel(axis(), moved(axis())); }

  void start(const MeanVoltage& voltage) {
    startVoltage(voltage.volt);
    addToFlanks(voltage.volt);
    calibration_.emplace(options());
    calibration_->start(voltage.volt, voltage.std);
  }

  void update(const MeanVoltage& voltage) {
    calibration_->addVoltage(voltage.volt, voltage.std);
    const std::optional<SensorCurve> curve = calibration_->curve();
    if (!curve || usesCrossSensor()) return;
    measurement_.approach.setCurve(*curve);
    addToFlanks(voltage.volt);
    calibration_->setSafeTravel(calibration_->travelled() + safeTravel());
  }

  SensorCalibrationOptions options() const {
    const HammerParameters& p = measurement_.parameters;
    const HammerStation& station = measurement_.station;
    SensorCalibrationOptions o;
    o.first_jog = p.first_jog;
    o.max_jog = p.max_jog;
    o.least_jog = p.least_jog;
    o.resolution = p.resolution;
    o.zero_volt = p.zero_volt;
    o.check_jog = p.check_jog;
    o.curve_jog = p.curve_jog;
    o.position_std = p.position_std;
    o.range_volt = station.range_volt;
    o.gain_volt = station.gain_volt;
    o.gap_at_zero_volt = station.gap_at_zero_volt;
    o.min_gap = p.min_gap_share * station.gap_at_zero_volt;
    o.swing = measurement_.swing.value_or(0.0);
    // A flute faces the hammer, so the sensor may face the gap between two flutes.
    o.max_travel = p.max_approach + station.flute_depth;
    o.safe_travel = safeTravel();
    return o;
  }

  void storeSensor() {
    const SensorCalibrationResult& result = calibration_->result();
    sensor() = {result.sensitivity, result.sensitivity_std, result.curve_gap, result.curve_gap_std,
                calibration_->volt()};
    const std::string limit = result.limited_by_edges
                                  ? formatted(" at %.2f V, limited by the tool's edges", sensor().volt)
                                  : std::string();
    measurement_.report(formatted("sensor calibrated: %.3f +- %.3f um/V", 1e6 * sensor().sensitivity,
                                  1e6 * sensor().sensitivity_std) +
                            limit,
                        endProgress());
  }

  std::optional<SensorCalibration> calibration_;
};

class CalibrateFirstSensor : public CalibrateSensor {
 public:
  using CalibrateSensor::CalibrateSensor;

 private:
  double startDelay() const override { return measurement_.parameters.rest_time; }  // after the trial hit
  void startVoltage(double volt) override { measurement_.flank_volt = volt; }
  double endProgress() const override { return 0.62; }
};

class CalibrateCrossSensor : public CalibrateSensor {
 public:
  using CalibrateSensor::CalibrateSensor;

  bool isNeeded() const override { return control_.hasCrossSensor(); }
  StepOutcome begin(double now) override {
    measurement_.cross_calibration_done = true;
    return CalibrateSensor::begin(now);
  }

 private:
  bool usesCrossSensor() const override { return true; }
  SensorState& sensor() override { return measurement_.cross.sensor; }
  double endProgress() const override { return 0.66; }
  StepOutcome calibrationFailed(const std::string& reason) override {
    measurement_.no_cross = reason;
    measurement_.report("no cross FRF: " + reason, endProgress());
    return StepOutcome::done();
  }
};

class RepeatCalibration : public CalibrateSensor {
 public:
  using CalibrateSensor::CalibrateSensor;

  bool isNeeded() const override { return measurement_.cross_calibration_done; }

 private:
  bool updatesFlanks() const override { return false; }
  double endProgress() const override { return 0.7; }
};

class CalibrateAtSecondHeight : public CalibrateSensor {
 public:
  using CalibrateSensor::CalibrateSensor;

  bool isNeeded() const override { return measurement_.at_second_height; }
  StepOutcome begin(double now) override {
    measurement_.report("calibrating the displacement sensor at the second height", 0.85);
    return CalibrateSensor::begin(now);
  }

 private:
  void startVoltage(double volt) override {
    // Nearer than at the tip at the same angle: the flutes end here or run otherwise. Then nothing is known
    // of the flanks, and the tool counts as round.
    const SensorApproach& approach = measurement_.approach;
    if (approach.nominalGap(volt) <
        approach.nominalGap(measurement_.flank_volt) -
            measurement_.parameters.same_flank * measurement_.station.gap_at_zero_volt)
      measurement_.approach.clearFlanks();
  }
  SensorState& sensor() override { return measurement_.second.sensor; }
  double endProgress() const override { return 0.87; }
  StepOutcome calibrationFailed(const std::string& reason) override {
    measurement_.no_second_height = "sensor calibration: " + reason;
    return StepOutcome::hitsCompleted();
  }
};

}  // namespace

StepPtr calibrateSensor(Measurement& measurement, StationControl& control) {
  return std::make_unique<CalibrateFirstSensor>(measurement, control);
}
StepPtr calibrateCrossSensor(Measurement& measurement, StationControl& control) {
  return std::make_unique<CalibrateCrossSensor>(measurement, control);
}
StepPtr repeatCalibration(Measurement& measurement, StationControl& control) {
  return std::make_unique<RepeatCalibration>(measurement, control);
}
StepPtr calibrateAtSecondHeight(Measurement& measurement, StationControl& control) {
  return std::make_unique<CalibrateAtSecondHeight>(measurement, control);
}

}  // namespace smartmill::hammer
