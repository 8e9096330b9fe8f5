#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_loadmeter/calibration/friction_law.h"
#include "smartmill_loadmeter/motor/force_estimate.h"
#include "smartmill_loadmeter/motor/motor_calibration.h"
#include "smartmill_loadmeter/motor/motor_chain.h"

namespace smartmill::loadmeter {

/// What a session's own air moves and first cuts say of the drives: friction of each axis over its speed,
/// and, from cuts whose force another sensor saw (dynamometer, sensor in the spindle; the load meter alone,
/// with the doubt that leaves), force and torque an ampere. No standard cuts from elsewhere are needed.
class SelfCalibration {
 public:
  explicit SelfCalibration(const MotorParameters& parameters) : parameters_(parameters) {}
  void clear();

  /// A test in air. @param stamp [s]
  void air(const MotorReading& reading, double stamp);
  /// A cut. @param seen its force by what is no motor
  void cut(const MotorReading& reading, const ForceEstimate& seen);

  /// Air readings so far, and what each axis' friction law says of this cut's feed where none was near it.
  std::vector<MotorReading> airFor(const MotorReading& cut) const;
  /// Empty before three cuts told of an axis or of the spindle.
  const std::optional<MotorCalibration>& calibration() const { return calibration_; }
  /// What was learnt, one line. @param bandwidth [Hz] of the drives' lags
  std::string text(const std::array<std::optional<Estimate>, 3>& bandwidth) const;

 private:
  struct Air {
    MotorReading reading;
    double stamp = 0.0;
  };
  struct Cut {
    MotorReading reading;
    ForceEstimate seen;
  };
  void calibrate();
  std::optional<DriveCalibration> drive(std::size_t axis) const;
  std::optional<TorquePowerLaw> spindle() const;
  void learnFriction(std::size_t axis);

  MotorParameters parameters_;
  std::vector<Air> air_;
  std::vector<Cut> cuts_;
  std::array<std::optional<FittedFriction>, 3> friction_;  // [A] over [m/s]
  std::array<double, 3> slowest_{}, fastest_{};            // [m/s] of the air moves
  std::optional<MotorCalibration> calibration_;
};

}  // namespace smartmill::loadmeter
