#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string>

#include "smartmill_hammer/search/approach_curve.h"

namespace smartmill::hammer {

struct SensorCalibrationResult {
  double sensitivity = 0.0, sensitivity_std = 0.0;  ///< [m/V] > 0: displacement towards the sensor per volt
  /// [m] > 0: gap of the hyperbola at the rest position; NaN: too few samples determine it. Its standard
  /// deviation comes from voltages, positions and the residual of the hyperbola.
  double curve_gap = std::numeric_limits<double>::quiet_NaN();
  double curve_gap_std = std::numeric_limits<double>::quiet_NaN();
  bool limited_by_edges = false;  ///< the approach ended at safe_travel instead of at zero volt
};

/// Moves the tool towards the sensor in small jogs until its voltage is about zero, and measures its
/// sensitivity there (eq. 4.8, 4.9). The samples of the approach also give the sensor's curve in front of
/// this tool, V = a + K / (g - x): with its gap g the symmetric measurement about the rest position is exact
/// to the next order, and a vibration can be linearised. Where the tool must not come near enough (its edges
/// extend further than the surface in front of the sensor), the sensitivity is that of the nearest position.
/// Resumable: start(volt), then, while state() is jogging: jog by nextJog(), measure, addVoltage().
class SensorCalibration {
 public:
  enum class State { jogging, done, failed };

  explicit SensorCalibration(const SensorCalibrationOptions& options);

  /// @param volt [V] mean before the first jog @param volt_std [V] standard deviation of that mean
  void start(double volt, double volt_std);
  void addVoltage(double volt, double volt_std);

  State state() const { return state_; }
  const std::string& reason() const { return reason_; }  ///< of a failure, one line
  double nextJog() const { return next_jog_; }           ///< [m] signed; positive towards the sensor
  int jogs() const { return jogs_; }
  double travelled() const { return travelled_; }  ///< [m] towards the sensor since start()

  const SensorCalibrationResult& result() const { return result_; }  ///< after the end
  /// The sensor's curve from the approach so far; empty: not yet determined.
  std::optional<SensorCurve> curve() const;
  /// To be called before the next sample. @param safe_travel [m] since start()
  void setSafeTravel(double safe_travel) { options_.safe_travel = safe_travel; }
  double volt() const { return volt_; }  ///< [V] last sample

 private:
  void planJog();
  void requestJog(double distance);
  void fail(std::string reason);
  void startCheck();
  void finish();
  void updateSensitivity(double change, double moved, double noise);
  double curveVoltStd() const;
  void requestReturn();
  void moveAway();

  enum class Phase { approach, check_near, check_far, bend_near, bend_far, check_back };

  SensorCalibrationOptions options_;
  State state_ = State::jogging;
  Phase phase_ = Phase::approach;
  std::string reason_;
  double next_jog_ = 0.0, travelled_ = 0.0;
  double rest_ = 0.0;                   // [m] travelled to the rest position
  double volt_ = 0.0, volt_std_ = 0.0;  // last sample
  double near_volt_ = 0.0, near_std_ = 0.0;
  SensorCalibrationResult result_;
  ApproachCurve samples_;
  int jogs_ = 0;
  std::size_t samples_away_ = 0;  // samples still to be taken away from the sensor
};

}  // namespace smartmill::hammer
