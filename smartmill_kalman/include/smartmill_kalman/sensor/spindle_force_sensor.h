#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/filter/low_pass.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"

namespace smartmill::kalman {

/// Counts for diagnostics, since the start.
struct SpindleSensorHealth {
  std::size_t unloaded = 0;    ///< samples at which a sensor had less than least_compression left
  std::size_t overloaded = 0;  ///< samples at which a sensor was beyond its range
  double compression_margin = std::numeric_limits<double>::infinity();  ///< [N] least compression of any sensor over
                                                                ///< least_compression
  std::size_t air_segments = 0;  ///< stretches without cutting that told zero and unbalance
  std::array<std::complex<double>, 3> unbalance{};  ///< [kg m]
  std::array<double, 3> unbalance_std{{0, 0, 0}};   ///< [kg m]; 0: none known
  double zero_std =
      0.0;  ///< [N] of the zero of a pair, last block: grows in a cut with the drift's uncertainty
};

/// Spindle-integrated force sensor (Burzoni ch. 3): blocks of six sensors in, blocks of fx, fy, fz with the
/// same index out: zero and drift off, pairs (eq. 3-1), constants at this length of tool and holder (3-4),
/// static and dynamic cross-talk (3-5, 3-7), unbalance off (3-6).
///
/// Zero, drift and unbalance are learnt while nothing is cut (condition AIR or NONE) and serve from the next
/// condition on, at any speed: the unbalance pulls with the square of the speed and shows through the axis'
/// own dynamics. What stands at a cut: line of the sensor's drift extrapolated, with its standard deviation.
///
/// A sensor that a lateral force would unload, or that is overloaded, does not measure: fx, fy and fz of that
/// sample are NaN and invalid() names it. Inputs in stamp order.
class SpindleForceSensor {
 public:
  /// @param length [m] of tool and holder. @throws Error when a constant is not positive there.
  SpindleForceSensor(const SpindleSensorCalibration& calibration, double length);

  /// Whether a block is one of this sensor: it has the first of its channels.
  static bool isSixChannels(const SampleBlock& block);

  /// Columns of the six sensors. @throws Error when one is missing or not in N.
  static std::array<std::size_t, 6> columnsOf(const SampleBlock& block);

  /// Dynamics of an axis (shown over applied, static gain 1) through which the unbalance shows.
  void setSensor(std::size_t axis, const ModalModel& sensor) { sensor_.at(axis) = sensor; }

  void handle(const SpindleAngle& angle);
  void handle(const CuttingCondition& condition);
  /// @throws Error when a channel is missing or not in N.
  SampleBlock handle(const SampleBlock& block);

  /// Of the last block: samples that are no measurement.
  const std::vector<bool>& invalid() const { return invalid_; }
  bool anyInvalid() const { return any_invalid_; }

  /// The causal low-pass of the calibration on a measured block, NaN kept.
  void lowPass(ForceBlock& block);

  void reset();
  const SpindleSensorHealth& health() const { return health_; }

 private:
  /// Sums of a stretch without cutting: offset, drift, cosine and sine of the spindle angle of every pair.
  struct AirSegment {
    double from = 0.0, speed = 0.0;  // [s], [rad/s]
    std::size_t samples = 0;
    std::array<std::array<double, 4>, 4> normal{};
    std::array<std::array<double, 4>, 6> right{};
    std::array<double, 6> squares{};
    std::array<double, 6> first{};  // [N] taken off so that sums stay small
  };
  struct Zero {
    double at = 0.0;  // [s] where offset holds
    std::array<double, 6> offset{}, drift{};
    double oo = 0.0, od = 0.0, dd = 0.0;  // covariance of offset and drift, worst sensor
  };
  void addPendingSamples(double before);
  void addAirSample(double time, double angle, double speed, const std::array<double, 6>& sensors);
  void closeAirSegment();
  void updateZero();
  void prepareCrossTalkFilters(const SampleBlock& block);
  bool isRotating() const;
  /// [N] of the unbalance at a time [s], complex: its real part shows.
  std::array<std::complex<double>, 3> unbalanceForce(double time) const;
  /// @return whether all six measure: none unloaded or overloaded, which is counted.
  bool subtractZero(double time, std::array<double, 6>& sensors);
  std::array<double, 3> forceOf(const std::array<double, 6>& sensors);
  /// A sample that is no measurement: the cross-talk's courses go on with the last forces.
  void skipSample();
  std::array<std::complex<double>, 3> calibratedAmplitudes(const std::array<std::complex<double>, 3>& means,
                                                         double f) const;

  SpindleSensorCalibration calibration_;
  double length_;
  std::array<double, 3> constant_{};  // of x, y, z
  double yx_, yz_, xz_;               // pair per load; 0: none
  std::array<ModalModel, 3> sensor_;
  std::vector<ModalFilter> cross_talk_filters_;  // of yx, yz, xz
  double cross_talk_rate_ = 0.0;          // [Hz]
  std::array<double, 3> last_{{0, 0, 0}};
  std::vector<LowPass> low_pass_;
  double low_pass_rate_ = 0.0;
  std::uint64_t next_low_pass_ = 0;

  std::optional<CuttingCondition::Kind> kind_;
  // Samples wait a block: a condition may tell afterwards that they belong to a cut.
  std::vector<std::array<double, 6>> pending_;
  double pending_from_ = 0.0, pending_rate_ = 0.0;  // [s], [Hz]
  SpindleAngle pending_angle_;
  std::optional<AirSegment> air_segment_;
  std::optional<Zero> zero_;
  SpindleAngle angle_;
  bool angle_known_ = false;
  std::array<double, 3> weight_{{0, 0, 0}};         // [1/(kg m)^2]
  std::array<std::complex<double>, 3> weighted_{};  // weight x unbalance
  std::vector<bool> invalid_;
  bool any_invalid_ = false;
  std::optional<std::uint64_t> next_index_;
  SpindleSensorHealth health_;
};

}  // namespace smartmill::kalman
