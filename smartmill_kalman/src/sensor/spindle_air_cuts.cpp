#include "smartmill_kalman/sensor/spindle_air_cuts.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;

/// Fit of a segment with the prior of the drift: amplitudes of each sensor and their covariance.
struct SegmentFit {
  std::array<Eigen::Vector4d, 6> x;
  std::array<double, 6> variance{};  // of one sample [N2]
  std::array<Eigen::Matrix4d, 6> covariance;
};

template <typename AirSegment>
SegmentFit solve(const AirSegment& s, double drift_std, double min_speed) {
  Eigen::Matrix4d normal;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j <= i; ++j) normal(i, j) = normal(j, i) = s.normal[i][j];
  }
  if (s.speed < min_speed) {  // at rest there is no synchronous part
    normal.bottomRows<2>().setZero();
    normal.rightCols<2>().setZero();
    normal(2, 2) = normal(3, 3) = 1.0;
  }
  SegmentFit solved;
  for (std::size_t k = 0; k < 6; ++k) {
    Eigen::Vector4d right(s.right[k][0], s.right[k][1], s.right[k][2], s.right[k][3]);
    if (s.speed < min_speed) right.tail<2>().setZero();
    Eigen::Matrix4d with_prior = normal;
    double variance = 0.0;
    for (int pass = 0; pass < 2; ++pass) {  // the weight of the prior depends on the noise
      with_prior(1, 1) = normal(1, 1) + variance / (drift_std * drift_std);
      solved.x[k] = with_prior.ldlt().solve(right);
      const double squares =
          s.squares[k] - 2.0 * solved.x[k].dot(right) + solved.x[k].dot(normal * solved.x[k]);
      variance = std::max(0.0, squares) / std::max(1.0, static_cast<double>(s.samples) - 4.0);
    }
    solved.variance[k] = variance;
    solved.covariance[k] = variance * with_prior.ldlt().solve(Eigen::Matrix4d::Identity());
  }
  return solved;
}

}  // namespace

SpindleAirCuts::SpindleAirCuts(const SpindleSensorCalibration& calibration, const SpindleConstants& constants,
                               const AirCutOptions& options)
    : calibration_(calibration), constants_(constants), options_(options) {
  for (ModalModel& sensor : sensor_) sensor.direct = 1.0;
  reset();
}

void SpindleAirCuts::reset() {
  out_of_work_ = false;
  air_segment_.reset();
  zero_.reset();
  pending_.clear();
  angle_known_ = false;
  segments_ = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double std_dev = calibration_.unbalance_std[axis];
    weight_[axis] = std_dev > 0.0 ? 1.0 / (std_dev * std_dev) : 0.0;
    weighted_[axis] = weight_[axis] * calibration_.unbalance[axis];
    unbalance_[axis] = calibration_.unbalance[axis];
    unbalance_std_[axis] = std_dev;
  }
}

void SpindleAirCuts::keepUnbalance(const SpindleAirCuts& before) {
  weight_ = before.weight_;
  weighted_ = before.weighted_;
  unbalance_ = before.unbalance_;
  unbalance_std_ = before.unbalance_std_;
}

void SpindleAirCuts::handle(const SpindleAngle& angle) {
  angle_ = angle;
  angle_known_ = true;
}

void SpindleAirCuts::handle(const CuttingCondition& condition) {
  addPendingSamples(condition.stamp);
  closeAirSegment();
  out_of_work_ = !condition.isInWork();
}

void SpindleAirCuts::beginBlock(const SampleBlock& block) {
  addPendingSamples(std::numeric_limits<double>::infinity());
  learning_ = out_of_work_;
  if (!learning_) return;
  pending_from_ = block.stamp;
  pending_rate_ = block.sample_rate;
  pending_angle_ = angle_known_ ? angle_ : SpindleAngle{};
}

void SpindleAirCuts::addPendingSamples(double before) {
  for (std::size_t i = 0; i < pending_.size(); ++i) {
    const double time = pending_from_ + static_cast<double>(i) / pending_rate_;
    if (time >= before) break;
    const double angle = pending_angle_.angle + pending_angle_.speed * (time - pending_angle_.stamp);
    addAirSample(time, angle, pending_angle_.speed, pending_[i]);
  }
  pending_.clear();
  if (air_segment_) updateZero();
}

void SpindleAirCuts::addAirSample(double time, double angle, double speed,
                                  const std::array<double, 6>& sensors) {
  for (const double s : sensors) {
    if (!std::isfinite(s)) return;
  }
  if (air_segment_ && std::abs(speed - air_segment_->speed) >
                          options_.steady * std::max(air_segment_->speed, options_.min_speed))
    closeAirSegment();
  if (!air_segment_) {
    air_segment_ = AirSegment{};
    air_segment_->from = time;
    air_segment_->speed = speed;
    air_segment_->first = sensors;
  }
  AirSegment& s = *air_segment_;
  const std::array<double, 4> row{1.0, time - s.from, std::cos(angle), std::sin(angle)};
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j <= i; ++j) s.normal[i][j] += row[i] * row[j];
  }
  for (std::size_t k = 0; k < 6; ++k) {
    const double value = sensors[k] - s.first[k];
    s.squares[k] += value * value;
    for (std::size_t i = 0; i < 4; ++i) s.right[k][i] += row[i] * value;
  }
  ++s.samples;
}

void SpindleAirCuts::updateZero() {
  const AirSegment& s = *air_segment_;
  const double span = pending_rate_ > 0.0 ? static_cast<double>(s.samples) / pending_rate_ : 0.0;
  if (span < options_.min_time) return;
  const SegmentFit solved = solve(s, calibration_.drift_std, options_.min_speed);
  Zero zero;
  zero.at = s.from;
  for (std::size_t k = 0; k < 6; ++k) {
    zero.offset[k] = s.first[k] + solved.x[k](0);
    zero.drift[k] = solved.x[k](1);
    if (solved.covariance[k](1, 1) < zero.dd) continue;
    zero.oo = solved.covariance[k](0, 0);
    zero.od = solved.covariance[k](0, 1);
    zero.dd = solved.covariance[k](1, 1);
  }
  zero_ = zero;
}

void SpindleAirCuts::closeAirSegment() {
  if (!air_segment_) return;
  const AirSegment s = *air_segment_;
  air_segment_.reset();
  const double span = pending_rate_ > 0.0 ? static_cast<double>(s.samples) / pending_rate_ : 0.0;
  if (span < options_.min_time) return;
  ++segments_;
  if (s.speed < options_.min_speed || span * s.speed < options_.min_revolutions * units::TWO_PI) return;
  const SegmentFit solved = solve(s, calibration_.drift_std, options_.min_speed);
  std::array<double, 6> re{}, im{}, variance{};
  for (std::size_t k = 0; k < 6; ++k) {
    re[k] = solved.x[k](2);
    im[k] = -solved.x[k](3);
    variance[k] = solved.covariance[k](2, 2) + solved.covariance[k](3, 3);
  }
  const auto real = pairMeans(re), imaginary = pairMeans(im);
  const double f = s.speed / units::TWO_PI;
  const std::array<Complex, 3> amplitude = constants_.forceOf(
      {Complex(real[0], imaginary[0]), Complex(real[1], imaginary[1]), Complex(real[2], imaginary[2])}, f);
  const std::array<double, 3> force_variance = constants_.varianceOf(variance);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Complex response = s.speed * s.speed * sensor_[axis].response(f);
    const double floor = std::pow(options_.systematic * std::abs(amplitude[axis]), 2);
    const double weight = std::norm(response) / std::max(force_variance[axis] + floor, 1e-300);
    weight_[axis] += weight;
    weighted_[axis] += weight * amplitude[axis] / response;
    unbalance_[axis] = weighted_[axis] / weight_[axis];
    unbalance_std_[axis] = 1.0 / std::sqrt(weight_[axis]);
  }
}

bool SpindleAirCuts::isRotating() const {
  return angle_known_ && angle_.speed >= options_.min_speed;
}

std::array<Complex, 3> SpindleAirCuts::unbalanceForce(double time) const {
  std::array<Complex, 3> force{};
  if (!isRotating()) return force;
  const double f = angle_.speed / units::TWO_PI;
  const Complex phase = std::polar(1.0, angle_.angle + angle_.speed * (time - angle_.stamp));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (weight_[axis] > 0.0)
      force[axis] = unbalance_[axis] * angle_.speed * angle_.speed * sensor_[axis].response(f) * phase;
  }
  return force;
}

Complex SpindleAirCuts::turn(double sample_rate) const {
  return isRotating() ? std::polar(1.0, angle_.speed / sample_rate) : 1.0;
}

}  // namespace smartmill::kalman
