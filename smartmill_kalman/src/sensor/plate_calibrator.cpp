#include "smartmill_kalman/sensor/plate_calibrator.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/filter/matrix_inverse.h"

namespace smartmill::kalman {

using Code = CalibrationResult::Code;
using Eigen::Index;

namespace {

constexpr double QUIET = 0.75;  // [1] of the time before the trigger: no force yet
constexpr double LOW = 0.05;    // [1] of the bandwidth: the plate is rigid up to there

CalibrationResult describeMatrix(const TransferMatrix& matrix, double bandwidth) {
  CalibrationResult result;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<Index>(axis);
    double weights = 0.0, sum = 0.0;
    std::vector<double> errors;
    for (std::size_t l = 1; l < matrix.frequency.size() && matrix.frequency[l] <= bandwidth; ++l) {
      // The error of the inverse is -inverse (error of forward) inverse, applied to the reading of a force
      // along the axis.
      const Eigen::VectorXd from_readings = matrix.inverse[l].row(k).cwiseAbs2().transpose();
      errors.push_back(std::sqrt(from_readings.dot(matrix.forward_std[l].col(k).cwiseAbs2())));
      if (matrix.frequency[l] > LOW * bandwidth) continue;
      const double weight = 1.0 / std::pow(matrix.inverse_std[l](k, k), 2);
      weights += weight;
      sum += weight * matrix.inverse[l](k, k).real();
    }
    if (errors.empty()) continue;
    result.error[axis] = median(errors);
    result.constant[axis] = sum / weights;
    result.constant_std[axis] = 1.0 / std::sqrt(weights);
  }
  result.message =
      formatted("expected error x %.2f, y %.2f, z %.2f %% up to %.0f Hz", 100.0 * result.error[0],
                100.0 * result.error[1], 100.0 * result.error[2], bandwidth);
  return result;
}

/// [1] Difference of the force by the matrix from that of the hammer over the latter, RMS up to the
/// bandwidth, of the taps along x, y, z; NaN without taps. @param quiet [s] at the start of each record,
/// without force
std::array<double, 3> differences(const TransferMatrix& matrix, double bandwidth, const TapRecords& records,
                                  double quiet) {
  MatrixInverse inverse(matrix, bandwidth);
  std::array<double, 3> wrong{}, all{}, result{};
  for (const MatrixTap& tap : records.taps) {
    if (tap.channels.size() != inverse.channels()) continue;
    const std::size_t axis = static_cast<std::size_t>(
        std::max_element(tap.direction.begin(), tap.direction.end(),
                         [](double a, double b) { return std::abs(a) < std::abs(b); }) -
        tap.direction.begin());
    const std::size_t samples = tap.hammer.size(), late = inverse.latency();
    std::vector<std::vector<double>> readings = tap.channels;
    std::vector<double> hammer = tap.hammer;
    for (std::vector<double>& reading : readings) {
      const double zero =
          mean({reading.begin(), reading.begin() + static_cast<std::ptrdiff_t>(quiet * records.rate)});
      for (double& value : reading) value -= zero;
      reading.resize(samples + late, 0.0);
    }
    inverse.reset();
    std::vector<double> force = inverse.process(readings)[axis];
    force.erase(force.begin(), force.begin() + static_cast<std::ptrdiff_t>(late));
    for (double& value : hammer) value *= tap.direction[axis];
    const std::vector<double> frequency = fourierFrequencies(samples, records.rate);
    const auto estimated = fourier(force), true_force = fourier(hammer);
    for (std::size_t l = 1; l < frequency.size() && frequency[l] <= bandwidth; ++l) {
      wrong[axis] += std::norm(estimated[l] - true_force[l]);
      all[axis] += std::norm(true_force[l]);
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis)
    result[axis] = all[axis] > 0.0 ? std::sqrt(wrong[axis] / all[axis]) : NOT_A_NUMBER;
  return result;
}

}  // namespace

CalibrationResult PlateCalibrator::handle(const CalibrationGoal& goal) {
  CalibrationResult result;
  if (goal.step == CalibrationGoal::Step::forget) reset();
  if (goal.step == CalibrationGoal::Step::point) {
    const bool finite =
        std::all_of(goal.load.begin(), goal.load.end(), [](double v) { return std::isfinite(v); });
    if (!finite) {
      result.code = Code::bad_goal;
      result.message = "point: expected finite numbers";
      return result;
    }
    point_ = goal.load;
    result.message = formatted("taps of kalman/measure_frf are now at %.1f %.1f %.1f mm",
                               goal.load[0] / units::MM, goal.load[1] / units::MM, goal.load[2] / units::MM);
    reference_point_ = goal.reference;
  } else if (goal.step == CalibrationGoal::Step::fit || goal.step == CalibrationGoal::Step::verify) {
    try {
      result = goal.step == CalibrationGoal::Step::fit ? fit() : verify();
    } catch (const Error& e) {
      result.code = Code::fit_failed;
      result.message = e.what();
    }
  }
  result.readings = (result.verified ? reference_ : records_).taps.size();
  return result;
}

CalibrationResult PlateCalibrator::fit() const {
  const TransferMatrix matrix = identifyTransferMatrix(records_.taps, records_.rate);
  std::set<std::array<double, 3>> points;
  for (const MatrixTap& tap : records_.taps) points.insert(tap.point);
  CalibrationResult result = describeMatrix(matrix, bandwidth_);
  result.message =
      formatted("%zu taps at %zu points: matrix of %zu channels, condition %.1f (median of %zu lines), ",
                records_.taps.size(), points.size(), matrix.channels, median(matrix.condition),
                matrix.frequency.size()) +
      result.message;
  result.matrix = matrix;
  return result;
}

CalibrationResult PlateCalibrator::verify() const {
  if (!matrix_) throw Error("verify: the plate is not calibrated");
  if (reference_.taps.empty()) throw Error("verify: no taps at a point with reference");
  CalibrationResult result;
  result.verified = true;
  result.error = differences(*matrix_, bandwidth_, reference_, QUIET * parameters_.pre_trigger);
  double worst = 0.0;
  result.message = "difference from the hammer";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(result.error[axis])) continue;
    worst = std::max(worst, result.error[axis]);
    result.message += formatted(" %s %.2f %%,", AXIS_NAMES[axis], 100.0 * result.error[axis]);
  }
  result.message += formatted(" limit %.0f", 100.0 * LARGEST_STATIC_ERROR);
  if (worst > LARGEST_STATIC_ERROR) result.code = Code::fit_failed;
  return result;
}

CalibrationResult PlateCalibrator::describe() const {
  return describeMatrix(*matrix_, bandwidth_);
}

void PlateCalibrator::use(const TransferMatrix& matrix, double bandwidth) {
  matrix_ = matrix;
  bandwidth_ = bandwidth;
}

void PlateCalibrator::reset() {
  PlateCalibrator fresh(parameters_, bandwidth_);
  fresh.matrix_ = std::move(matrix_);
  *this = std::move(fresh);
}

void PlateCalibrator::handle(const SampleBlock& block) {
  if (!collector_) return;
  if (columns_.empty()) {
    const bool six =
        std::find(block.channels.begin(), block.channels.end(), PLATE_CHANNELS[3]) != block.channels.end();
    for (std::size_t c = 0; c < (six ? 6 : 3); ++c) columns_.push_back(block.channel(PLATE_CHANNELS[c]));
    collector_.emplace(parameters_, columns_.size());
    collector_->begin();
  }
  for (std::size_t i = 0; i < block.size(); ++i) {
    std::vector<double> values;
    for (const std::size_t c : columns_) values.push_back(block.at(i, c));
    collector_->add(block.timeOf(i), block.first_index + i, block.sample_rate, std::move(values));
  }
}

void PlateCalibrator::handleHammer(const SampleBlock& block) {
  if (collector_) collector_->handleHammer(block);
}

void PlateCalibrator::beginTaps(const std::string& direction) {
  if (!point_) return;
  direction_ = direction;
  columns_.clear();  // from the first block
  collector_.emplace(parameters_, 0);
}

void PlateCalibrator::endTaps(const SensorResult& result) {
  if (!collector_) return;
  const std::optional<std::size_t> axis = axisIndex(direction_);
  if (result.code == FrfCode::ok && axis) {
    TapRecords& records = reference_point_ ? reference_ : records_;
    if (records.rate != collector_->rate())
      records = {{}, collector_->rate()};  // another sample rate: another device
    for (std::vector<Hit>& hit : collector_->acceptedHits(result)) {
      MatrixTap tap;
      tap.point = *point_;
      // The sensor gives the direction of the hit.
      tap.direction[*axis] = result.static_gain < 0.0 ? -1.0 : 1.0;
      tap.hammer = std::move(hit[0].force);
      for (Hit& channel : hit) tap.channels.push_back(std::move(channel.response));
      records.taps.push_back(std::move(tap));
    }
  }
  collector_.reset();
}

}  // namespace smartmill::kalman
