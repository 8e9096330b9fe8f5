#include "smartmill_loadmeter/motor/axis_drive.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

constexpr Eigen::Index TERMS = 4;
const std::array<const char*, TERMS> NAMES{"inertia", "Coulomb friction", "viscous friction", "offset"};

double signOf(double v) {
  return v > 0.0 ? 1.0 : v < 0.0 ? -1.0 : 0.0;
}

/// Regression of all records, one after the other.
struct Rows {
  std::vector<double> terms;        // TERMS in a row
  std::vector<double> current;      // [A]
  std::vector<Eigen::Index> begin;  // row of each record, and the number of rows
};

void addRows(const AxisMotion& move, const AxisDriveOptions& options, Rows& rows) {
  const auto size = static_cast<std::size_t>(std::max(3.0, std::round(options.smoothing * move.sample_rate)));
  // Symmetric: the periodic window without its zero. The smoothed acceleration is minus its derivative times
  // the velocity.
  std::vector<double> window = hannWindow(size + 1), slope(size + 1);
  const double sum = 0.5 * static_cast<double>(size + 1), angle = units::PI / sum;
  for (std::size_t i = 0; i <= size; ++i) {
    window[i] /= sum;
    slope[i] = -0.5 * std::sin(angle * static_cast<double>(i)) * angle * move.sample_rate / sum;
  }
  const auto step =
      std::max<std::size_t>(1, static_cast<std::size_t>(options.step * static_cast<double>(size)));
  for (std::size_t at = 0; at + size <= move.velocity.size(); at += step) {
    double acceleration = 0.0, sign = 0.0, velocity = 0.0, current = 0.0;
    for (std::size_t i = 0; i < size; ++i) {
      const double v = move.velocity[at + i];
      acceleration += slope[i + 1] * v;
      sign += window[i + 1] * signOf(v);
      velocity += window[i + 1] * v;
      current += window[i + 1] * move.current[at + i];
    }
    rows.terms.insert(rows.terms.end(), {acceleration, sign, velocity, 1.0});
    rows.current.push_back(current);
  }
}

void check(const std::vector<AxisMotion>& moves, const AxisDriveOptions& options) {
  if (moves.empty()) throw Error("axis drive: no move given");
  for (const AxisMotion& move : moves) {
    if (!(move.sample_rate > 0.0)) throw Error("axis drive: sample rate above 0 expected");
    if (move.velocity.size() != move.current.size())
      throw Error("axis drive: " + std::to_string(move.velocity.size()) + " velocities and " +
                  std::to_string(move.current.size()) + " currents, expected as many of both");
    const double seconds = static_cast<double>(move.velocity.size()) / move.sample_rate;
    if (seconds < 4.0 * options.smoothing)
      throw Error("axis drive: a move of " + std::to_string(seconds) + " s, expected at least " +
                  std::to_string(4.0 * options.smoothing) + " s");
    const auto finite = [](double x) { return std::isfinite(x); };
    if (!std::all_of(move.velocity.begin(), move.velocity.end(), finite) ||
        !std::all_of(move.current.begin(), move.current.end(), finite))
      throw Error("axis drive: velocity or current is not a finite number");
  }
}

/// Sum over rows and lags of score times score, with Bartlett's weights, within each record.
Eigen::Matrix4d scoreCovariance(const Eigen::MatrixX4d& scores, const std::vector<Eigen::Index>& begin,
                                Eigen::Index lags) {
  Eigen::Matrix4d sum = scores.transpose() * scores;
  for (std::size_t r = 0; r + 1 < begin.size(); ++r) {
    const Eigen::MatrixX4d record = scores.middleRows(begin[r], begin[r + 1] - begin[r]);
    for (Eigen::Index lag = 1; lag <= std::min(lags, record.rows() - 1); ++lag) {
      const Eigen::Matrix4d product =
          record.bottomRows(record.rows() - lag).transpose() * record.topRows(record.rows() - lag);
      sum +=
          (1.0 - static_cast<double>(lag) / static_cast<double>(lags + 1)) * (product + product.transpose());
    }
  }
  return sum;
}

}  // namespace

std::string AxisDrive::text() const {
  return formatted(
      "inertia %.4f +- %.4f A s2/m, Coulomb %.4f +- %.4f A, viscous %.4f +- %.4f A s/m, offset %.4f +- %.4f "
      "A; "
      "residual %.4f A RMS",
      inertia.value, inertia.std_dev, coulomb.value, coulomb.std_dev, viscous.value, viscous.std_dev,
      offset.value, offset.std_dev, residual);
}

AxisMotion axisMotion(const Record& record, double sample_rate, char axis) {
  AxisMotion motion;
  motion.sample_rate = sample_rate;
  motion.current = record.column(std::string("current_") + axis);
  const std::string velocity = std::string("axis_v") + axis;
  if (record.has(velocity)) {
    motion.velocity = record.column(velocity);
    return motion;
  }
  const std::vector<double>& position = record.column(std::string("axis_") + axis);
  motion.velocity.resize(position.size());
  for (std::size_t i = 0; i < position.size(); ++i) {
    const std::size_t before = i > 0 ? i - 1 : 0;
    const std::size_t after = std::min(i + 1, position.size() - 1);
    if (after > before)
      motion.velocity[i] =
          (position[after] - position[before]) / static_cast<double>(after - before) * sample_rate;
  }
  return motion;
}

AxisDrive identifyAxisDrive(const std::vector<AxisMotion>& moves, const AxisDriveOptions& options) {
  check(moves, options);
  Rows rows;
  for (const AxisMotion& move : moves) {
    rows.begin.push_back(static_cast<Eigen::Index>(rows.current.size()));
    addRows(move, options, rows);
  }
  const auto count = static_cast<Eigen::Index>(rows.current.size());
  rows.begin.push_back(count);
  const Eigen::MatrixX4d terms =
      Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, TERMS, Eigen::RowMajor>>(rows.terms.data(),
                                                                                      count, TERMS);
  const Eigen::Map<const Eigen::VectorXd> current(rows.current.data(), count);
  AxisDrive drive;
  drive.largest_acceleration = terms.col(0).cwiseAbs().maxCoeff();
  drive.largest_velocity = terms.col(2).cwiseAbs().maxCoeff();
  if (drive.largest_velocity == 0.0) throw Error("axis drive: the axis does not move");
  // Friction at rest has no direction, so that rest does not separate it from the offset.
  if (terms.col(1).maxCoeff() < 0.5 || terms.col(1).minCoeff() > -0.5)
    throw Error(
        "axis drive: moves in both directions expected, to separate Coulomb friction from the offset");
  // Of size one, so that the inverse is comparable.
  const Eigen::RowVector4d scale = terms.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixX4d scaled = terms.array().rowwise() / scale.array();
  // Collinear terms give a large inverse, not an undefined one.
  const Eigen::Matrix4d normal = scaled.transpose() * scaled + 1e-12 * Eigen::Matrix4d::Identity();
  const Eigen::LDLT<Eigen::Matrix4d> solver(normal);
  const Eigen::Matrix4d inverse = solver.solve(Eigen::Matrix4d::Identity());
  for (Eigen::Index k = 0; k < TERMS; ++k) {
    if (!(inverse(k, k) > 0.0 && inverse(k, k) < options.inflation * options.inflation))
      throw Error(std::string("axis drive: the moves do not determine the ") +
                  NAMES[static_cast<std::size_t>(k)] + "; expected " +
                  (k == 0 ? "accelerations" : "moves at different velocities"));
  }
  const Eigen::Vector4d solution = solver.solve(scaled.transpose() * current);
  const Eigen::VectorXd residual = current - scaled * solution;
  const Eigen::MatrixX4d scores = scaled.array().colwise() * residual.array();
  const auto lags = static_cast<Eigen::Index>(std::ceil(options.correlated / options.step));
  const Eigen::Matrix4d covariance = inverse * scoreCovariance(scores, rows.begin, lags) * inverse;
  const auto estimate = [&](Eigen::Index k) {
    return Estimate{solution[k] / scale[k], std::sqrt(std::max(0.0, covariance(k, k))) / scale[k]};
  };
  drive.inertia = estimate(0);
  drive.coulomb = estimate(1);
  drive.viscous = estimate(2);
  drive.offset = estimate(3);
  drive.residual = std::sqrt(residual.squaredNorm() / static_cast<double>(count));
  const double variance = (current.array() - current.mean()).square().sum();
  drive.explained = variance > 0.0 ? 1.0 - residual.squaredNorm() / variance : 1.0;
  return drive;
}

}  // namespace smartmill::loadmeter
