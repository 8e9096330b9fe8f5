#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_hammer/search/flute_search.h"
#include "smartmill_hammer/search/sensor_calibration.h"

namespace smartmill::hammer {

struct SensorApproachOptions {
  double face = 8e-3;  ///< [m] diameter of the sensor's face
  /// [1] possible deviation of gain and curvature from the nominal curve. Far from the sensor, where the
  /// nominal curve is flat, depths between flutes would otherwise be overestimated.
  double curve_error = 0.15;
  double min_gap = 125e-6;  ///< [m] that remains to the face
  /// [m] diameter of the electrode: a voltage is the mean over that much of a flank, as if measured further
  /// from the flute by the mean distance from the disc's diameter.
  double electrode = 2e-3;
  double measured_curve_error = 0.01;  ///< [1] of the measured curve: nonlinearity of the amplifier
  int face_steps = 12;                 ///< points checked over the face's radius
  double turn_step = 0.03;             ///< [rad] between two angles checked of the tool
};

/// How far a fluted tool may move towards the sensor's round face without contact, from the voltages that the
/// sensor itself has measured of the tool's surface. The sensor measures at the middle of its face; next to
/// the middle the face meets other angles of the tool, above and below it what the helix has turned there.
/// The bounds are conservative: no point of the tool is nearer, as long as the sensor's curve is within its
/// error.
class SensorApproach {
 public:
  SensorApproach(const smartmill::HammerStation& station, const ToolGeometry& tool,
                 const SensorApproachOptions& options);

  /// Replaces all flanks by a search's measurements of one flute. @param angle [rad] and @param volt [V] of
  /// the flute
  void startFromFlute(const std::vector<FluteSearch::Measurement>& measurements, double angle, double volt);
  /// Adds a measurement to the flanks of the flutes on either side; the last one at an angle counts.
  /// @param turned [rad] rotation of the spindle from a flute at the sensor
  /// @param moved [m] nearer to the sensor than where the flute was measured
  /// @param same_sensor false: not the sensor that measured the flute and whose curve setCurve() states
  void addMeasurement(double turned, double volt, double moved, bool same_sensor = true);
  /// Replaces the nominal curve by that of the calibration and evaluates all measurements again. Ignored
  /// where it contradicts the nominal curve's error.
  void setCurve(const SensorCurve& curve);
  /// Without flanks the tool counts as round.
  void clearFlanks();

  /// [m] smallest depth of the surface below a flute, at an angle [rad] from one. The root of the depth is
  /// interpolated linearly, which bounds round and straight flanks from below; beyond the last measurement
  /// the surface falls towards the gullet. Of uneven teeth any may be the flute that was found.
  double leastRetreat(double off) const;

  /// The tool in front of the sensor.
  struct Pose {
    double turned = 0.0;                   ///< [rad] of the spindle from a flute at the sensor's middle
    double above_tip = 0.0;                ///< [m] height of the sensor's middle
    double lag_low = 0.0, lag_high = 0.0;  ///< [rad/m] bounds of the helix's lag over height
  };
  /// [m] towards the sensor, from where the flute was measured, until the tool is as near to its face as
  /// permitted. At the start a flute leaves twice the gap at zero volt, or less if its voltage indicates so.
  double safeTravel(const Pose& pose) const;

  /// [m] from the sensor's nominal curve.
  double nominalGap(double volt) const;

 private:
  struct FlankMeasurement {
    double off, volt, moved;  // [rad] of the spindle from a flute at the sensor, [V], [m]
    bool same_sensor;
  };
  double rotationFromTooth(double off, int tooth, int found) const;
  double leastRetreatBetween(double first, double last) const;
  static double gap(double volt, const SensorCurve& curve, double error);
  SensorCurve nominal() const;
  double fluteGap() const;
  void updateProfile();
  double retreatOf(const FlankMeasurement& measurement) const;

  struct Retreat {
    double off, depth;  // [rad], [m] below the flute
  };

  smartmill::HammerStation station_;
  ToolGeometry tool_;
  SensorApproachOptions options_;
  SensorCurve curve_;
  double curve_error_;
  std::vector<double>
      tooth_rotations_;  // [rad] of each tooth from the flute found, whichever tooth that is; each once
  std::vector<FlankMeasurement> measurements_;
  std::vector<Retreat> profile_;  // of the measurements by curve_
  double flute_volt_ = 0.0;       // [V] of the flute that was found
};

}  // namespace smartmill::hammer
