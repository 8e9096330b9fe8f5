#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <optional>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/sensor/spindle_constants.h"

namespace smartmill::kalman {

/// Which segments without cutting determine zero and unbalance.
struct AirCutOptions {
  double steady =
      0.005;  ///< [1] change of speed that starts another segment; a controlled spindle keeps within
  double min_time = 0.1;          ///< [s] of a segment for the zero; a shorter one is a transition
  double min_revolutions = 10.0;  ///< [1] of a segment for the unbalance
  double min_speed = 1.0;         ///< [rad/s] for an unbalance; below it the spindle counts as at rest
  double systematic = 0.002;      ///< [1] relative error of an amplitude that does not average out
};

/// Zero and drift of the six sensors, and the unbalance of the spindle, from samples without cutting
/// (condition AIR or NONE); used from the next condition on, at any speed.
class SpindleAirCuts {
 public:
  struct Zero {
    double at = 0.0;  ///< [s] reference time of the offset
    std::array<double, 6> offset{}, drift{};
    double oo = 0.0, od = 0.0, dd = 0.0;  ///< covariance of offset and drift, worst sensor
  };

  SpindleAirCuts(const SpindleSensorCalibration& calibration, const SpindleConstants& constants,
                 const AirCutOptions& options = {});

  void reset();
  /// Takes over the unbalance, which was estimated with another calibration of the same sensor. The zero is
  /// estimated anew: weights may have been on the tool.
  void keepUnbalance(const SpindleAirCuts& before);
  /// Dynamics of an axis that the unbalance force passes.
  void setSensor(std::size_t axis, const ModalModel& sensor) { sensor_.at(axis) = sensor; }
  void handle(const SpindleAngle& angle);
  void handle(const CuttingCondition& condition);
  /// Before the samples of a block.
  void beginBlock(const SampleBlock& block);
  /// A sample of the block, as measured.
  void add(const std::array<double, 6>& sensors) {
    if (learning_) pending_.push_back(sensors);
  }

  const std::optional<Zero>& zero() const { return zero_; }
  std::size_t segments() const { return segments_; }  ///< used for zero and unbalance
  const std::array<std::complex<double>, 3>& unbalance() const { return unbalance_; }  ///< [kg m]
  const std::array<double, 3>& unbalanceStd() const { return unbalance_std_; }  ///< [kg m]; 0: none known
  /// Unbalance force at a time [s], complex [N]; the real part acts.
  std::array<std::complex<double>, 3> unbalanceForce(double time) const;
  /// Rotation of the unbalance force from sample to sample.
  std::complex<double> turn(double sample_rate) const;

 private:
  /// Normal equations of a segment without cutting: offset, drift, cosine and sine of the spindle angle.
  struct AirSegment {
    double from = 0.0, speed = 0.0;  // [s], [rad/s]
    std::size_t samples = 0;
    std::array<std::array<double, 4>, 4> normal{};
    std::array<std::array<double, 4>, 6> right{};
    std::array<double, 6> squares{};
    std::array<double, 6> first{};  // [N] subtracted for small sums
  };
  void addPendingSamples(double before);
  void addAirSample(double time, double angle, double speed, const std::array<double, 6>& sensors);
  void closeAirSegment();
  void updateZero();
  bool isRotating() const;

  SpindleSensorCalibration calibration_;
  SpindleConstants constants_;
  AirCutOptions options_;
  std::array<ModalModel, 3> sensor_;
  bool out_of_work_ = false;  // as the condition states
  bool learning_ = false;
  // Samples wait for one block: a condition may arrive that makes them part of a cut.
  std::vector<std::array<double, 6>> pending_;
  double pending_from_ = 0.0, pending_rate_ = 0.0;  // [s], [Hz]
  SpindleAngle pending_angle_;
  std::optional<AirSegment> air_segment_;
  std::optional<Zero> zero_;
  SpindleAngle angle_;
  bool angle_known_ = false;
  std::array<double, 3> weight_{{0, 0, 0}};         // [1/(kg m)^2]
  std::array<std::complex<double>, 3> weighted_{};  // weight x unbalance
  std::array<std::complex<double>, 3> unbalance_{};
  std::array<double, 3> unbalance_std_{{0, 0, 0}};
  std::size_t segments_ = 0;
};

}  // namespace smartmill::kalman
