#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/filter/low_pass.h"
#include "smartmill_kalman/sensor/spindle_air_cuts.h"
#include "smartmill_kalman/sensor/spindle_constants.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"

namespace smartmill::kalman {

/// Counts for diagnostics, since the start.
struct SpindleSensorHealth {
  std::size_t unloaded = 0;    ///< samples with a sensor below least_compression
  std::size_t overloaded = 0;  ///< samples with a sensor above its range limit
  double compression_margin = std::numeric_limits<double>::infinity();  ///< [N] least compression of any
                                                                        ///< sensor over least_compression
  std::size_t air_segments = 0;                     ///< segments without cutting used for zero and unbalance
  std::array<std::complex<double>, 3> unbalance{};  ///< [kg m]
  std::array<double, 3> unbalance_std{{0, 0, 0}};   ///< [kg m]; 0: none known
  double zero_std =
      0.0;  ///< [N] of the zero of a pair, last block; grows in a cut with the uncertainty of the drift
};

/// Spindle-integrated force sensor (Burzoni ch. 3): blocks of six sensors in, blocks of fx, fy, fz with the
/// same index out. Subtracts zero and drift, forms pairs (eq. 3-1), applies the constants at this length of
/// tool and holder (3-4), static and dynamic cross-talk (3-5, 3-7), and subtracts the unbalance (3-6).
///
/// Zero, drift and unbalance are estimated without cutting (condition AIR or NONE) and used from the next
/// condition on, at any speed: the unbalance force grows with the square of the speed and passes the dynamics
/// of the axis. In a cut the drift is extrapolated, with its standard deviation.
///
/// A sample with an unloaded or overloaded sensor is invalid: its fx, fy and fz are NaN, see invalid().
/// Inputs in stamp order.
class SpindleForceSensor {
 public:
  /// @param length [m] of tool and holder. @throws Error when a constant is not positive there.
  SpindleForceSensor(const SpindleSensorCalibration& calibration, double length);

  /// Whether a block is from such a sensor (by its first channel).
  static bool isSixChannels(const SampleBlock& block);

  /// Columns of the six sensors. @throws Error when one is missing or not in N.
  static std::array<std::size_t, 6> columnsOf(const SampleBlock& block);

  /// Dynamics of an axis (measured over applied, static gain 1) that the unbalance force passes.
  void setSensor(std::size_t axis, const ModalModel& sensor) { air_cuts_.setSensor(axis, sensor); }

  void handle(const SpindleAngle& angle) { air_cuts_.handle(angle); }
  void handle(const CuttingCondition& condition);
  /// @throws Error when a channel is missing or not in N.
  SampleBlock handle(const SampleBlock& block);

  /// Invalid samples of the last block.
  const std::vector<bool>& invalid() const { return invalid_; }
  bool anyInvalid() const { return any_invalid_; }

  /// The causal low-pass of the calibration on a measured block, NaN kept.
  void lowPass(ForceBlock& block);

  void reset();
  /// Takes over the unbalance of the spindle, which a new calibration of the sensor does not change.
  void keepUnbalance(const SpindleForceSensor& before);
  const SpindleSensorHealth& health() const { return health_; }

 private:
  void copyAirCuts();
  /// Counts unloaded and overloaded sensors. @return whether there is none.
  bool subtractZero(double time, std::array<double, 6>& sensors);

  SpindleSensorCalibration calibration_;
  SpindleCrossTalk cross_talk_;
  SpindleAirCuts air_cuts_;
  std::vector<LowPass> low_pass_;
  double low_pass_rate_ = 0.0;
  std::uint64_t next_low_pass_ = 0;
  std::vector<bool> invalid_;
  bool any_invalid_ = false;
  std::optional<std::uint64_t> next_index_;
  SpindleSensorHealth health_;
};

}  // namespace smartmill::kalman
