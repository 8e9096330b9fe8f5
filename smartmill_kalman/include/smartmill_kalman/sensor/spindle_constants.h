#pragma once

#include <array>
#include <complex>
#include <vector>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"

namespace smartmill::kalman {

/// Constants of a spindle-integrated force sensor at one length of tool and holder, with its cross-talk.
class SpindleConstants {
 public:
  /// @param length [m] of tool and holder. @throws Error when a constant is not positive there.
  SpindleConstants(const SpindleSensorCalibration& calibration, double length);

  /// Amplitudes of the force from those of the pairs' means at f [Hz].
  std::array<std::complex<double>, 3> forceOf(const std::array<std::complex<double>, 3>& means,
                                              double f) const;
  /// Variance of such a force [N2]. @param variance [N2] of each sensor
  std::array<double, 3> varianceOf(const std::array<double, 6>& variance) const;

 private:
  friend class SpindleCrossTalk;
  std::array<double, 3> constant_{};  // of x, y, z
  double yx_, yz_, xz_;               // pair per load; 0: none
  ModalModel dynamic_yx_, dynamic_yz_, dynamic_xz_;
};

/// From the six sensors to the force, sample by sample.
class SpindleCrossTalk {
 public:
  explicit SpindleCrossTalk(const SpindleConstants& constants) : constants_(constants) {}

  void reset() { filters_.clear(); }
  /// To be called before the samples of a block. @param rate [Hz] @param gap samples were lost before it
  void prepare(double rate, bool gap);
  std::array<double, 3> step(const std::array<double, 6>& sensors);
  /// Advances by the last valid force.
  void skip();

 private:
  SpindleConstants constants_;
  std::vector<ModalFilter> filters_;  // of yx, yz, xz
  double rate_ = 0.0;                 // [Hz]
  std::array<double, 3> last_{{0, 0, 0}};
};

}  // namespace smartmill::kalman
