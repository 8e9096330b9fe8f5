#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace smartmill::hammer {

/// Calibration of the displacement sensor in the machine (Dunwoody section 4.2). All distances [m] are
/// positive towards the sensor.
struct SensorCalibrationOptions {
  double first_jog = 50e-6;   ///< [m] > 0
  double max_jog = 100e-6;    ///< [m] >= first_jog
  double least_jog = 5e-6;    ///< [m] > 0; below this the machine's resolution dominates the sensitivity
  double resolution = 1e-6;   ///< [m] of a commanded distance
  double zero_volt = 0.1;     ///< [V] magnitude below which the sensor is zeroed
  double check_jog = 10e-6;   ///< [m] half width of the final, symmetric measurement about zero; 0: the
                              ///< sensitivity of the last approach jog is used, as in the thesis
  double curve_jog = 100e-6;  ///< [m] away from the sensor, where the curvature is measured at the end, and
                              ///< halfway; 0: from the samples of the approach alone
  double position_std = 0.1e-6;      ///< [m] of a distance moved (thesis: within 100 nm)
  double range_volt = 10.0;          ///< [V] the sensor saturates at plus and minus this
  double gain_volt = 10.0;           ///< [V] nominal curve V = gain_volt (gap_at_zero_volt / gap - 1)
  double gap_at_zero_volt = 250e-6;  ///< [m]
  double min_gap = 100e-6;           ///< [m] no jog to a nominal gap below this
  double swing = 0.0;  ///< [m] towards the sensor that a hit may cause; added to min_gap before a sharp edge
  double max_travel = 3e-3;   ///< [m] longest approach
  double safe_travel = 1.0;   ///< [m] without contact; the approach ends there
  double largest_std = 0.02;  ///< [1] relative, of the sensitivity where the approach ended early
  int max_jogs = 100;         ///< [1]
};

/// A sensor's curve V = far_volt + constant / gap.
struct SensorCurve {
  double far_volt = 0.0;  ///< [V] without a target
  double constant = 0.0;  ///< [V m]
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

  /// [m/V] > 0: displacement towards the sensor per volt, and its standard deviation.
  double sensitivity() const { return sensitivity_; }
  double sensitivityStd() const { return sensitivity_std_; }

  /// [m] > 0: gap of the hyperbola at the rest position; NaN: too few samples determine it.
  double curveGap() const { return curve_gap_; }
  /// [m] its standard deviation, from voltages, positions and the residual of the hyperbola.
  double curveGapStd() const { return curve_gap_std_; }
  /// The sensor's curve from the approach so far; empty: not yet determined.
  std::optional<SensorCurve> curve() const;
  /// To be called before the next sample. @param safe_travel [m] since start()
  void setSafeTravel(double safe_travel) { options_.safe_travel = safe_travel; }
  /// Whether the approach ended at safe_travel instead of at zero volt.
  bool isLimitedByEdges() const { return limited_by_edges_; }
  double volt() const { return volt_; }  ///< [V] last sample

 private:
  struct Sample {
    double position, volt;  // [m] since start(), [V]
  };
  void planJog();
  void requestJog(double distance);
  void fail(std::string reason);
  bool isClipped(double volt) const;
  double nominalGap(double volt) const;
  void startCheck();
  void finish();
  void updateSensitivity(double change, double moved, double noise);
  double localGap() const;
  struct Hyperbola {
    double gap, gap_std;            // [m]
    double far_volt, far_volt_std;  // [V]
    double constant;                // [V m]
  };
  Hyperbola hyperbola() const;
  Hyperbola hyperbola(double reach) const;
  Hyperbola fitHyperbola(const std::vector<Sample>& near) const;
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
  double sensitivity_ = 0.0, sensitivity_std_ = 0.0;
  double curve_gap_, curve_gap_std_;
  bool limited_by_edges_ = false;
  std::vector<Sample> samples_;
  int jogs_ = 0;
  std::size_t samples_away_ = 0;  // samples still to be taken away from the sensor
};

}  // namespace smartmill::hammer
