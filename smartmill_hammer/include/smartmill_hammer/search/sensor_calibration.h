#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace smartmill {
namespace hammer {

/// Calibration of the displacement sensor in place (Dunwoody section 4.2). All distances [m] along the
/// direction in which the tool nears the sensor.
struct SensorCalibrationOptions {
  double first_jog = 50e-6;   ///< [m] > 0
  double max_jog = 100e-6;    ///< [m] >= first_jog
  double least_jog = 5e-6;    ///< [m] > 0; below this the machine's resolution would spoil the sensitivity
  double resolution = 1e-6;   ///< [m] of a commanded distance
  double zero_volt = 0.1;     ///< [V] the sensor counts as zeroed below this
  double check_jog = 10e-6;   ///< [m] half width of the last, symmetric measurement about zero; 0: the
                              ///< thesis's way, the sensitivity of the last approach jog stands
  double curve_jog = 100e-6;  ///< [m] away from the sensor, where the curve's bend is read last, and halfway
                              ///< to it; 0: only by the approach's readings
  double position_std = 0.1e-6;      ///< [m] of a distance moved (thesis: within 100 nm)
  double range_volt = 10.0;          ///< [V] sensor clips at plus and minus this
  double gain_volt = 10.0;           ///< [V] nominal curve V = gain_volt (gap_at_zero_volt / gap - 1)
  double gap_at_zero_volt = 250e-6;  ///< [m]
  double min_gap = 100e-6;           ///< [m] no jog to a nominal gap below this
  double swing = 0.0;  ///< [m] towards the sensor that a blow may make, beside min_gap before a sharp edge
  double max_travel = 3e-3;   ///< [m] approach at most
  double safe_travel = 1.0;   ///< [m] nothing of the tool can touch before; the approach ends there
  double largest_std = 0.02;  ///< [1] of the sensitivity over itself, where the approach ended early
  int max_jogs = 100;         ///< [1]
};

/// A sensor's curve V = far_volt + constant / gap.
struct SensorCurve {
  double far_volt = 0.0;  ///< [V] where nothing stands before it
  double constant = 0.0;  ///< [V m]
};

/// Moves the tool towards the sensor in small jogs until its voltage is about zero, and measures its
/// sensitivity there (eq. 4.8, 4.9). The sensor's curve is measured with it: through the readings of the
/// approach goes a + K / (g - x), as before a flat target, whose g is the bend of this tool's curve; with it
/// the symmetric measurement about the resting place is exact to the next order, and who evaluates a
/// vibration can bend it straight. Where the tool may not come near enough (its edges reach out further than
/// what the sensor sees), the sensitivity is that of the nearest place. Resumable: start(volt), then as long
/// as state() is jogging: jog by next(), measure, give().
class SensorCalibration {
 public:
  enum class State { jogging, done, failed };

  explicit SensorCalibration(const SensorCalibrationOptions& options);

  /// @param volt [V] mean before the first jog @param volt_std [V] standard deviation of that mean
  void start(double volt, double volt_std);
  void give(double volt, double volt_std);

  State state() const { return state_; }
  const std::string& reason() const { return reason_; }  ///< of a failure, one line
  double next() const { return next_; }                  ///< [m] signed; positive towards the sensor
  int jogs() const { return jogs_; }
  double travelled() const { return travelled_; }  ///< [m] towards the sensor since start()

  /// [m/V] > 0: displacement towards the sensor per volt; and its standard deviation.
  double sensitivity() const { return sensitivity_; }
  double sensitivityStd() const { return sensitivity_std_; }

  /// [m] > 0: gap of the hyperbola that the sensor's curve follows here; NaN: too few readings tell.
  double bendGap() const { return bend_gap_; }
  /// [m] its standard deviation, by the readings' and the places' own and by what the hyperbola leaves.
  double bendGapStd() const { return bend_gap_std_; }
  /// What the approach so far tells of the sensor's curve; empty: too little.
  std::optional<SensorCurve> curve() const;
  /// Before the next reading. @param safe_travel [m] since start()
  void allow(double safe_travel) { options_.safe_travel = safe_travel; }
  /// Whether the approach ended at safe_travel instead of at zero volt.
  bool heldBack() const { return held_back_; }
  double volt() const { return volt_; }  ///< [V] last reading

 private:
  struct Reading {
    double at, volt;  // [m] towards the sensor, [V]
  };
  void plan();
  void ask(double distance);
  void fail(std::string reason);
  bool clipped(double volt) const;
  double nominalGap(double volt) const;
  void check();
  void finish();
  void approached(double change, double moved, double noise);
  double localGap() const;
  struct Hyperbola {
    double gap, gap_std;            // [m]
    double far_volt, far_volt_std;  // [V]
    double constant;                // [V m]
  };
  Hyperbola hyperbola() const;
  Hyperbola hyperbola(double reach) const;
  Hyperbola through(const std::vector<Reading>& near) const;
  void askBack();
  void further();

  enum class Phase { approach, check_near, check_far, bend_near, bend_far, check_back };

  SensorCalibrationOptions options_;
  State state_ = State::jogging;
  Phase phase_ = Phase::approach;
  std::string reason_;
  double next_ = 0.0, travelled_ = 0.0;
  double rest_ = 0.0;                   // [m] travelled to where the tool stays
  double volt_ = 0.0, volt_std_ = 0.0;  // last reading
  double near_volt_ = 0.0, near_std_ = 0.0;
  double sensitivity_ = 0.0, sensitivity_std_ = 0.0;
  double bend_gap_, bend_gap_std_;
  bool held_back_ = false;
  std::vector<Reading> readings_;
  int jogs_ = 0;
  std::size_t away_ = 0;  // readings further off still to be taken
};

}  // namespace hammer
}  // namespace smartmill
