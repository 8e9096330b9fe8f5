#include "smartmill_kalman/sensor/spindle_force_sensor.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/sensor/block_channels.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;

constexpr double STEADY = 0.005;          // [1] relative change of speed that starts another segment
constexpr double MIN_AIR_TIME = 0.1;      // [s] of a segment for the zero
constexpr double MIN_REVOLUTIONS = 10.0;  // [1] of a segment for the unbalance
constexpr double MIN_SPEED = 1.0;         // [rad/s] for an unbalance
constexpr double SYSTEMATIC = 0.002;      // [1] systematic relative error of an amplitude

ModalModel ideal() {
  ModalModel model;
  model.direct = 1.0;
  return model;
}

}  // namespace

SpindleForceSensor::SpindleForceSensor(const SpindleSensorCalibration& calibration, double length)
    : calibration_(calibration), length_(length) {
  calibration.validate();
  try {
    calibration.checkLength(length);
  } catch (const Error& error) {
    throw Error(std::string("spindle_sensor_length: ") + error.what());
  }
  constant_ = {calibration.x.at(length), calibration.y.at(length), calibration.z.at(length)};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(constant_[axis] > 0.0)) {
      throw Error(std::string("spindle sensor: constant ") + AXIS_NAMES[axis] + " is " +
                  std::to_string(constant_[axis]) + " at a length of " + std::to_string(length / units::MM) +
                  " mm, expected above 0");
    }
  }
  const auto share = [length](const std::optional<LengthDependence>& line) {
    return line ? 1.0 / line->at(length) : 0.0;
  };
  yx_ = share(calibration.yx);
  yz_ = share(calibration.yz);
  xz_ = share(calibration.xz);
  sensor_.fill(ideal());
  reset();
}

std::array<std::size_t, 6> SpindleForceSensor::columnsOf(const SampleBlock& block) {
  std::array<std::size_t, 6> column{};
  for (std::size_t k = 0; k < 6; ++k) column[k] = columnOf(block, SPINDLE_SENSOR_CHANNELS[k], "N");
  return column;
}

bool SpindleForceSensor::isSixChannels(const SampleBlock& block) {
  return std::find(block.channels.begin(), block.channels.end(), SPINDLE_SENSOR_CHANNELS[0]) !=
         block.channels.end();
}

void SpindleForceSensor::reset() {
  kind_.reset();
  air_segment_.reset();
  zero_.reset();
  pending_.clear();
  cross_talk_filters_.clear();
  low_pass_.clear();
  next_index_.reset();
  angle_known_ = false;
  any_invalid_ = false;
  health_ = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double std_dev = calibration_.unbalance_std[axis];
    weight_[axis] = std_dev > 0.0 ? 1.0 / (std_dev * std_dev) : 0.0;
    weighted_[axis] = weight_[axis] * calibration_.unbalance[axis];
    health_.unbalance[axis] = calibration_.unbalance[axis];
    health_.unbalance_std[axis] = std_dev;
  }
}

void SpindleForceSensor::handle(const SpindleAngle& angle) {
  angle_ = angle;
  angle_known_ = true;
}

void SpindleForceSensor::handle(const CuttingCondition& condition) {
  addPendingSamples(condition.stamp);
  closeAirSegment();
  kind_ = condition.kind;
}

void SpindleForceSensor::addPendingSamples(double before) {
  for (std::size_t i = 0; i < pending_.size(); ++i) {
    const double time = pending_from_ + static_cast<double>(i) / pending_rate_;
    if (time >= before) break;
    const double angle = pending_angle_.angle + pending_angle_.speed * (time - pending_angle_.stamp);
    addAirSample(time, angle, pending_angle_.speed, pending_[i]);
  }
  pending_.clear();
  if (air_segment_) updateZero();
}

void SpindleForceSensor::addAirSample(double time, double angle, double speed,
                                      const std::array<double, 6>& sensors) {
  for (const double s : sensors) {
    if (!std::isfinite(s)) return;
  }
  if (air_segment_ &&
      std::abs(speed - air_segment_->speed) > STEADY * std::max(air_segment_->speed, MIN_SPEED))
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

namespace {

/// Fit of a segment with the prior of the drift: amplitudes of each sensor and their covariance.
struct SegmentFit {
  std::array<Eigen::Vector4d, 6> x;
  std::array<double, 6> variance{};  // of one sample [N2]
  std::array<Eigen::Matrix4d, 6> covariance;
};

template <typename AirSegment>
SegmentFit solve(const AirSegment& s, double drift_std) {
  Eigen::Matrix4d normal;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j <= i; ++j) normal(i, j) = normal(j, i) = s.normal[i][j];
  }
  if (s.speed < MIN_SPEED) {  // at rest there is no synchronous part
    normal.bottomRows<2>().setZero();
    normal.rightCols<2>().setZero();
    normal(2, 2) = normal(3, 3) = 1.0;
  }
  SegmentFit solved;
  for (std::size_t k = 0; k < 6; ++k) {
    Eigen::Vector4d right(s.right[k][0], s.right[k][1], s.right[k][2], s.right[k][3]);
    if (s.speed < MIN_SPEED) right.tail<2>().setZero();
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

void SpindleForceSensor::updateZero() {
  const AirSegment& s = *air_segment_;
  const double span = pending_rate_ > 0.0 ? static_cast<double>(s.samples) / pending_rate_ : 0.0;
  if (span < MIN_AIR_TIME) return;
  const SegmentFit solved = solve(s, calibration_.drift_std);
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

std::array<Complex, 3> SpindleForceSensor::calibratedAmplitudes(const std::array<Complex, 3>& means,
                                                                double f) const {
  const Complex y = means[1] * constant_[1];
  const Complex x = (means[0] - y * yx_ * calibration_.dynamic_yx.response(f)) * constant_[0];
  const Complex z = (means[2] - y * yz_ * calibration_.dynamic_yz.response(f) -
                     x * xz_ * calibration_.dynamic_xz.response(f)) *
                    constant_[2];
  return {x, y, z};
}

void SpindleForceSensor::closeAirSegment() {
  if (!air_segment_) return;
  const AirSegment s = *air_segment_;
  air_segment_.reset();
  const double span = pending_rate_ > 0.0 ? static_cast<double>(s.samples) / pending_rate_ : 0.0;
  if (span < MIN_AIR_TIME) return;
  ++health_.air_segments;
  if (s.speed < MIN_SPEED || span * s.speed < MIN_REVOLUTIONS * units::TWO_PI) return;
  const SegmentFit solved = solve(s, calibration_.drift_std);
  std::array<double, 6> re{}, im{}, variance{};
  for (std::size_t k = 0; k < 6; ++k) {
    re[k] = solved.x[k](2);
    im[k] = -solved.x[k](3);
    variance[k] = solved.covariance[k](2, 2) + solved.covariance[k](3, 3);
  }
  const auto real = pairMeans(re), imaginary = pairMeans(im);
  const double f = s.speed / units::TWO_PI;
  const std::array<Complex, 3> amplitude = calibratedAmplitudes(
      {Complex(real[0], imaginary[0]), Complex(real[1], imaginary[1]), Complex(real[2], imaginary[2])}, f);
  const auto pair = [&](std::size_t axis) { return 0.25 * (variance[2 * axis] + variance[2 * axis + 1]); };
  const std::array<double, 3> own{constant_[0] * constant_[0] * pair(0),
                                  constant_[1] * constant_[1] * pair(1),
                                  constant_[2] * constant_[2] * pair(2)};
  // Including the cross-talk from the axes before.
  const std::array<double, 3> force_variance{
      own[0] + std::pow(constant_[0] * yx_, 2) * own[1], own[1],
      own[2] + std::pow(constant_[2] * yz_, 2) * own[1] + std::pow(constant_[2] * xz_, 2) * own[0]};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Complex response = s.speed * s.speed * sensor_[axis].response(f);
    const double floor = std::pow(SYSTEMATIC * std::abs(amplitude[axis]), 2);
    const double weight = std::norm(response) / std::max(force_variance[axis] + floor, 1e-300);
    weight_[axis] += weight;
    weighted_[axis] += weight * amplitude[axis] / response;
    health_.unbalance[axis] = weighted_[axis] / weight_[axis];
    health_.unbalance_std[axis] = 1.0 / std::sqrt(weight_[axis]);
  }
}

void SpindleForceSensor::prepareCrossTalkFilters(const SampleBlock& block) {
  const bool gap = next_index_ && *next_index_ != block.first_index;
  next_index_ = block.first_index + block.size();
  if (!cross_talk_filters_.empty() && cross_talk_rate_ == block.sample_rate && !gap) return;
  cross_talk_filters_.clear();
  for (const ModalModel* model :
       {&calibration_.dynamic_yx, &calibration_.dynamic_yz, &calibration_.dynamic_xz})
    cross_talk_filters_.emplace_back(*model, block.sample_rate, Hold::first_order);
  cross_talk_rate_ = block.sample_rate;
}

bool SpindleForceSensor::isRotating() const {
  return angle_known_ && angle_.speed >= MIN_SPEED;
}

std::array<Complex, 3> SpindleForceSensor::unbalanceForce(double time) const {
  std::array<Complex, 3> unbalance{};
  if (!isRotating()) return unbalance;
  const double f = angle_.speed / units::TWO_PI;
  const Complex phase = std::polar(1.0, angle_.angle + angle_.speed * (time - angle_.stamp));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (weight_[axis] > 0.0)
      unbalance[axis] =
          health_.unbalance[axis] * angle_.speed * angle_.speed * sensor_[axis].response(f) * phase;
  }
  return unbalance;
}

bool SpindleForceSensor::subtractZero(double time, std::array<double, 6>& sensors) {
  bool unloaded = false, overloaded = false;
  for (std::size_t k = 0; k < 6; ++k) {
    if (zero_) sensors[k] -= zero_->offset[k] + zero_->drift[k] * (time - zero_->at);
    const double compression = calibration_.preload[k] + sensors[k];
    const double left = compression - calibration_.least_compression;
    health_.compression_margin = std::min(health_.compression_margin, left);
    unloaded = unloaded || left <= 0.0;
    overloaded = overloaded || compression > calibration_.range_limit;
  }
  if (unloaded) ++health_.unloaded;
  if (overloaded) ++health_.overloaded;
  return !unloaded && !overloaded;
}

std::array<double, 3> SpindleForceSensor::forceOf(const std::array<double, 6>& sensors) {
  const std::array<double, 3> means = pairMeans(sensors);
  const double y = means[1] * constant_[1];
  const double x = (means[0] - yx_ * cross_talk_filters_[0].step(y)) * constant_[0];
  const double z =
      (means[2] - yz_ * cross_talk_filters_[1].step(y) - xz_ * cross_talk_filters_[2].step(x)) * constant_[2];
  return {x, y, z};
}

void SpindleForceSensor::skipSample() {
  cross_talk_filters_[0].step(last_[1]);
  cross_talk_filters_[1].step(last_[1]);
  cross_talk_filters_[2].step(last_[0]);
}

SampleBlock SpindleForceSensor::handle(const SampleBlock& block) {
  const std::array<std::size_t, 6> column = columnsOf(block);
  addPendingSamples(std::numeric_limits<double>::infinity());
  prepareCrossTalkFilters(block);
  SampleBlock forces;
  forces.stamp = block.stamp;
  forces.sample_rate = block.sample_rate;
  forces.first_index = block.first_index;
  forces.channels.assign(FORCE_CHANNELS.begin(), FORCE_CHANNELS.end());
  forces.units = {"N", "N", "N"};
  forces.samples.reserve(3 * block.size());
  invalid_.assign(block.size(), false);
  any_invalid_ = false;
  const bool learning = kind_ && *kind_ != CuttingCondition::Kind::cut;
  if (learning) {
    pending_from_ = block.stamp;
    pending_rate_ = block.sample_rate;
    pending_angle_ = angle_known_ ? angle_ : SpindleAngle{};
  }
  // Unbalance at the first sample and its rotation to the next.
  std::array<Complex, 3> unbalance = unbalanceForce(block.stamp);
  const Complex turn = isRotating() ? std::polar(1.0, angle_.speed / block.sample_rate) : 1.0;
  for (std::size_t i = 0; i < block.size(); ++i) {
    std::array<double, 6> sensors{};
    bool finite = true;
    for (std::size_t k = 0; k < 6; ++k) {
      sensors[k] = block.at(i, column[k]);
      finite = finite && std::isfinite(sensors[k]);
    }
    if (learning) pending_.push_back(sensors);
    invalid_[i] = finite && !subtractZero(block.timeOf(i), sensors);
    any_invalid_ = any_invalid_ || invalid_[i];
    if (finite && !invalid_[i]) {
      last_ = forceOf(sensors);
      for (std::size_t axis = 0; axis < 3; ++axis)
        forces.samples.push_back(last_[axis] - unbalance[axis].real());
    } else {
      skipSample();
      forces.samples.insert(forces.samples.end(), 3, NOT_A_NUMBER);
    }
    for (Complex& p : unbalance) p *= turn;
  }
  if (zero_) {
    const double t = block.stamp - zero_->at;
    health_.zero_std = std::sqrt(std::max(0.0, 0.5 * (zero_->oo + 2.0 * zero_->od * t + zero_->dd * t * t)));
  }
  return forces;
}

void SpindleForceSensor::lowPass(ForceBlock& block) {
  if (calibration_.low_pass <= 0.0) return;
  if (low_pass_.empty() || low_pass_rate_ != block.sample_rate || next_low_pass_ != block.first_index) {
    low_pass_.assign(3, LowPass(calibration_.low_pass, block.sample_rate));
    low_pass_rate_ = block.sample_rate;
  }
  next_low_pass_ = block.first_index + block.force[0].size();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (double& force : block.force[axis]) force = low_pass_[axis].step(force);
  }
}

}  // namespace smartmill::kalman
