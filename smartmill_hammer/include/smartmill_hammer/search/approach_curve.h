#pragma once

#include <optional>
#include <vector>

#include "smartmill_hammer/search/sensor_calibration_options.h"

namespace smartmill::hammer {

/// A sensor's curve V = far_volt + constant / gap.
struct SensorCurve {
  double far_volt = 0.0;  ///< [V] without a target
  double constant = 0.0;  ///< [V m]
};

/// Voltages of a displacement sensor along an approach of the tool, and the curve of the sensor through them.
class ApproachCurve {
 public:
  struct Hyperbola {
    double gap, gap_std;            ///< [m] at the last sample
    double far_volt, far_volt_std;  ///< [V]
    double constant;                ///< [V m]
  };

  explicit ApproachCurve(const SensorCalibrationOptions& options) : options_(options) {}

  /// @param position [m] since the start, positive towards the sensor @param volt [V]
  void add(double position, double volt) { samples_.push_back({position, volt}); }
  std::size_t size() const { return samples_.size(); }
  /// Whether a voltage [V] does not depend on the distance.
  bool isClipped(double volt) const;
  /// [m] gap by the nominal curve.
  double nominalGap(double volt) const;
  /// [m] gap of the hyperbola through the last three samples of the approach, whose slope is proportional to
  /// 1 / gap^2. In front of a sharp edge it falls long before the nominal gap does. Infinite: undetermined.
  double localGap() const;
  /// V = a + K / (g - (x - x_now)) through the nearby samples: within `curve_jog` where those exist,
  /// otherwise within that gap itself. Further away other regions of the tool contribute. @param volt_std [V]
  /// of a sample
  Hyperbola hyperbola(double volt_std) const;
  /// The curve through all samples; empty: not yet determined.
  std::optional<SensorCurve> curve(double volt_std) const;

 private:
  struct Sample {
    double position, volt;  // [m] since start(), [V]
  };
  double position() const { return samples_.back().position; }
  Hyperbola within(double reach, double volt_std) const;
  Hyperbola fitHyperbola(const std::vector<Sample>& near, double volt_std) const;

  SensorCalibrationOptions options_;
  std::vector<Sample> samples_;
};

}  // namespace smartmill::hammer
