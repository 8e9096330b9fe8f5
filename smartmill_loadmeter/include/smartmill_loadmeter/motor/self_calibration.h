#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_loadmeter/calibration/friction_law.h"
#include "smartmill_loadmeter/motor/force_estimate.h"
#include "smartmill_loadmeter/motor/motor_calibration.h"
#include "smartmill_loadmeter/motor/motor_chain.h"

namespace smartmill::loadmeter {

/// Calibration of the drives by a session's own air moves and cuts, without standard cuts: friction of each
/// axis over velocity, and force and torque per ampere from cuts whose force another sensor measured
/// (dynamometer, spindle sensor; or the load meter alone, with its larger uncertainty). The newest MOST
/// tests in air and MOST cuts count: production has no end, and each cut is compared with all tests in air.
class SelfCalibration {
 public:
  static constexpr std::size_t MOST = 100;  ///< [1]

  explicit SelfCalibration(const MotorParameters& parameters) : parameters_(parameters) {}
  void clear();

  /// Adds a test in air. @param stamp [s]
  void air(const MotorMeasurement& measurement, double stamp);
  /// Adds a cut. @param reference its force without motor currents
  void cut(const MotorMeasurement& measurement, const ForceEstimate& reference);

  /// Measurements in air, completed by each axis' friction law for this cut's feed if there is none near it.
  std::vector<MotorMeasurement> airFor(const MotorMeasurement& cut) const;
  /// Empty with fewer than three cuts for each axis and the spindle.
  const std::optional<MotorCalibration>& calibration() const { return calibration_; }
  /// Calibration in one line. @param bandwidth [Hz] of the drives' lags
  std::string text(const std::array<std::optional<Estimate>, 3>& bandwidth) const;

 private:
  struct Air {
    MotorMeasurement measurement;
    double stamp = 0.0;
  };
  struct Cut {
    MotorMeasurement measurement;
    ForceEstimate reference;
  };
  void calibrate();
  std::optional<DriveCalibration> drive(std::size_t axis) const;
  std::vector<SpindleCut> spindleCuts() const;
  std::optional<TorquePowerLaw> spindle(const std::vector<SpindleCut>& cuts) const;
  void updateFriction(std::size_t axis);

  MotorParameters parameters_;
  std::vector<Air> air_;
  std::vector<Cut> cuts_;
  std::array<std::optional<FittedFriction>, 3> friction_;  // [A] over [m/s]
  std::array<double, 3> slowest_{}, fastest_{};            // [m/s] of the air moves
  std::array<double, 3> temperature_{};                    // [K] mean in the air moves; NaN: unknown
  std::optional<MotorCalibration> calibration_;
};

}  // namespace smartmill::loadmeter
