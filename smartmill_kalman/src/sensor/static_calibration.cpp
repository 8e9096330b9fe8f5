// Constants of a spindle-integrated force sensor from weights hung on a tool.

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <Eigen/Core>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"

namespace smartmill::kalman {
namespace {

/// Least squares with standard deviations from the residuals; empty columns must not be given.
struct LeastSquares {
  Eigen::VectorXd x, std_dev;
  double residual = 0.0;  // RMS
};

LeastSquares solve(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, const std::string& what) {
  const linear::LeastSquares fitted = linear::leastSquares(a, b);
  if (fitted.rank < a.cols()) throw Error(what + ": the measurements do not determine all constants");
  LeastSquares found;
  found.x = fitted.x;
  const Eigen::Index free = a.rows() - a.cols();
  const double squares = (b - a * found.x).squaredNorm();
  found.residual = std::sqrt(squares / static_cast<double>(std::max<Eigen::Index>(1, a.rows())));
  const double variance = squares / static_cast<double>(std::max<Eigen::Index>(1, free));
  const Eigen::MatrixXd covariance = linear::inverseSymmetric(Eigen::MatrixXd(a.transpose() * a));
  found.std_dev = (variance * covariance.diagonal()).cwiseMax(0.0).cwiseSqrt();
  return found;
}

ConstantsAtLength constantsOf(const StaticMeasurements& measurements, double length) {
  std::map<int, Eigen::Index> tests;
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    if (measurements.length[i] != length) continue;
    tests.emplace(measurements.test[i], static_cast<Eigen::Index>(tests.size()));
    rows.push_back(i);
  }
  const auto n = static_cast<Eigen::Index>(rows.size());
  const auto columns = 3 + 2 * static_cast<Eigen::Index>(tests.size());
  const std::string what = measurements.file + ": length " + std::to_string(length / units::MM) + " mm";
  if (n <= columns) throw Error(what + ": too few measurements");
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n, columns), b(n, 3);
  for (Eigen::Index r = 0; r < n; ++r) {
    const std::size_t i = rows[static_cast<std::size_t>(r)];
    const Eigen::Index test = 3 + 2 * tests.at(measurements.test[i]);
    for (Eigen::Index j = 0; j < 3; ++j) a(r, j) = measurements.load[i][static_cast<std::size_t>(j)];
    a(r, test) = 1.0;
    a(r, test + 1) = measurements.time[i] - measurements.time[rows.front()];
    const auto means = pairMeans(measurements.sensors[i]);
    for (Eigen::Index k = 0; k < 3; ++k) b(r, k) = means[static_cast<std::size_t>(k)];
  }
  for (Eigen::Index j = 0; j < 3; ++j) {
    if (a.col(j).isZero()) throw Error(what + ": no load along " + AXIS_NAMES[static_cast<std::size_t>(j)]);
  }
  ConstantsAtLength found;
  found.length = length;
  double squares = 0.0;
  for (Eigen::Index k = 0; k < 3; ++k) {
    const LeastSquares line = solve(a, b.col(k), what);
    for (Eigen::Index j = 0; j < 3; ++j) {
      found.share[k][j] = line.x(j);
      found.std_dev[k][j] = line.std_dev(j);
    }
    for (Eigen::Index t = 4; t < columns; t += 2) found.drift = std::max(found.drift, std::abs(line.x(t)));
    squares += line.residual * line.residual;
  }
  found.residual = std::sqrt(squares / 3.0);
  return found;
}

/// Weighted line over length of the constants, or of their reciprocals, and its chi squared.
std::pair<LengthDependence, double> fitLine(const std::vector<ConstantsAtLength>& lengths, int row,
                                            int column, bool reciprocal) {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  double middle = 0.0, weights = 0.0;
  std::vector<std::array<double, 3>> points;  // length, value, weight
  for (const ConstantsAtLength& l : lengths) {
    const double share = l.share[row][column], value = reciprocal ? share : 1.0 / share;
    const double moves = reciprocal ? 1.0 : value * value;
    const double std_dev = std::max(l.std_dev[row][column] * moves, 1e-12 * std::abs(value));
    points.push_back({l.length, value, 1.0 / (std_dev * std_dev)});
    middle += points.back()[0] * points.back()[2];
    weights += points.back()[2];
  }
  middle /= weights;
  LengthDependence line;
  line.reciprocal = reciprocal;
  if (points.size() == 1) {
    line.offset = points[0][1];
    line.slope_std = line.covariance = 0.0;
    line.offset_std = 1.0 / std::sqrt(points[0][2]);
    return {line, 0.0};
  }
  for (const auto& [length, value, weight] : points) {
    const Eigen::Vector2d row_of(length - middle, 1.0);
    normal += weight * row_of * row_of.transpose();
    right += weight * value * row_of;
  }
  const Eigen::Matrix2d covariance = linear::inverseSymmetric(Eigen::MatrixXd(normal));
  const Eigen::Vector2d x = covariance * right;
  line.slope = x(0);
  line.offset = x(1) - x(0) * middle;
  line.slope_std = std::sqrt(covariance(0, 0));
  line.offset_std = std::sqrt(covariance(1, 1) + middle * middle * covariance(0, 0));
  line.covariance = -middle * covariance(0, 0);
  double chi2 = 0.0;
  for (const auto& [length, value, weight] : points)
    chi2 += weight * std::pow(value - line.slope * length - line.offset, 2);
  return {line, chi2};
}

/// Constant over length: linear, unless measurements at three lengths or more prove a linear reciprocal.
LengthDependence lengthDependenceOf(const std::vector<ConstantsAtLength>& lengths, int row, int column,
                                    double proven) {
  const auto [line, chi2] = fitLine(lengths, row, column, false);
  if (lengths.size() < 3) return line;
  const auto [beam, beam_chi2] = fitLine(lengths, row, column, true);
  return chi2 - beam_chi2 > proven ? beam : line;
}

/// Cross-talk that is significant at every length.
std::optional<LengthDependence> crossTalkOf(const std::vector<ConstantsAtLength>& lengths, int row,
                                            int column, const StaticCalibrationOptions& options) {
  for (const ConstantsAtLength& l : lengths) {
    if (!(std::abs(l.share[row][column]) > options.significant * l.std_dev[row][column])) return {};
  }
  return lengthDependenceOf(lengths, row, column, options.proven_reciprocal);
}

}  // namespace

StaticMeasurements readStaticMeasurements(const std::string& file) {
  const auto columns = readColumns(file, {"test", "time[s]", "length[mm]", "load_x[N]", "load_y[N]",
                                          "load_z[N]", "x1[N]", "x2[N]", "y1[N]", "y2[N]", "z1[N]", "z2[N]"});
  StaticMeasurements measurements;
  measurements.file = file;
  for (std::size_t i = 0; i < columns[0].size(); ++i) {
    measurements.test.push_back(static_cast<int>(std::lround(columns[0][i])));
    measurements.time.push_back(columns[1][i]);
    measurements.length.push_back(columns[2][i] * units::MM);
    measurements.load.push_back({columns[3][i], columns[4][i], columns[5][i]});
    measurements.sensors.push_back(
        {columns[6][i], columns[7][i], columns[8][i], columns[9][i], columns[10][i], columns[11][i]});
  }
  return measurements;
}

StaticCalibration calibrateStatic(const StaticMeasurements& measurements,
                                  const SpindleSensorCalibration& base,
                                  const StaticCalibrationOptions& options) {
  const std::set<double> lengths(measurements.length.begin(), measurements.length.end());
  if (lengths.empty()) throw Error(measurements.file + ": no measurements");
  StaticCalibration result;
  result.calibration = base;
  for (const double length : lengths) result.lengths.push_back(constantsOf(measurements, length));
  for (const ConstantsAtLength& l : result.lengths) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!(std::abs(l.share[axis][axis]) > options.significant * l.std_dev[axis][axis])) {
        throw Error(measurements.file + ": length " + std::to_string(l.length / units::MM) + " mm: pair " +
                    AXIS_NAMES[static_cast<std::size_t>(axis)] + " does not respond to its load");
      }
    }
  }
  result.calibration.lengths = {*lengths.begin() - options.length_margin,
                                *lengths.rbegin() + options.length_margin};
  result.calibration.x = lengthDependenceOf(result.lengths, 0, 0, options.proven_reciprocal);
  result.calibration.y = lengthDependenceOf(result.lengths, 1, 1, options.proven_reciprocal);
  result.calibration.z = lengthDependenceOf(result.lengths, 2, 2, options.proven_reciprocal);
  result.calibration.yx = crossTalkOf(result.lengths, 0, 1, options);
  result.calibration.yz = crossTalkOf(result.lengths, 2, 1, options);
  result.calibration.xz = crossTalkOf(result.lengths, 2, 0, options);
  return result;
}

void checkLengths(const StaticMeasurements& measurements, const SpindleSensorCalibration& calibration) {
  try {
    for (const double length : measurements.length) calibration.checkLength(length);
  } catch (const Error& error) {
    throw Error(measurements.file + ": " + error.what());
  }
}

std::array<double, 3> verifyStatic(const StaticMeasurements& measurements,
                                   const SpindleSensorCalibration& calibration) {
  checkLengths(measurements, calibration);
  std::array<double, 3> worst{}, largest{};
  const std::set<int> tests(measurements.test.begin(), measurements.test.end());
  for (const int test : tests) {
    std::vector<std::size_t> rows, unloaded;
    for (std::size_t i = 0; i < measurements.size(); ++i) {
      if (measurements.test[i] != test) continue;
      rows.push_back(i);
      const auto& l = measurements.load[i];
      if (l[0] == 0.0 && l[1] == 0.0 && l[2] == 0.0) unloaded.push_back(i);
    }
    const std::string what = measurements.file + ": test " + std::to_string(test);
    if (unloaded.size() < 2)
      throw Error(what + ": expected two or more measurements without load (zero and drift)");
    const auto n = static_cast<Eigen::Index>(unloaded.size());
    Eigen::MatrixXd a(n, 2), b(n, 3);
    for (Eigen::Index r = 0; r < n; ++r) {
      const std::size_t i = unloaded[static_cast<std::size_t>(r)];
      a.row(r) << 1.0, measurements.time[i] - measurements.time[rows.front()];
      const auto f = staticForce(calibration, measurements.length[i], pairMeans(measurements.sensors[i]));
      b.row(r) << f[0], f[1], f[2];
    }
    const Eigen::MatrixXd zero = linear::leastSquares(a, b).x;
    for (const std::size_t i : rows) {
      const auto f = staticForce(calibration, measurements.length[i], pairMeans(measurements.sensors[i]));
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto k = static_cast<Eigen::Index>(axis);
        const double estimated =
            f[axis] - zero(0, k) - zero(1, k) * (measurements.time[i] - measurements.time[rows.front()]);
        worst[axis] = std::max(worst[axis], std::abs(estimated - measurements.load[i][axis]));
        largest[axis] = std::max(largest[axis], std::abs(measurements.load[i][axis]));
      }
    }
  }
  const double any = *std::max_element(largest.begin(), largest.end());
  if (!(any > 0.0)) throw Error(measurements.file + ": no measurement has a load");
  for (std::size_t axis = 0; axis < 3; ++axis) worst[axis] /= largest[axis] > 0.0 ? largest[axis] : any;
  return worst;
}

ModalModel fitDynamicCrossTalk(const std::vector<std::vector<double>>& force,
                               const std::vector<std::vector<double>>& cross, double constant,
                               double sample_rate, double low, double high, int max_modes) {
  if (force.empty() || force.size() != cross.size()) throw Error("dynamic cross-talk: no taps");
  FrfEstimator estimator(sample_rate, force.front().size());
  for (std::size_t i = 0; i < force.size(); ++i) {
    std::vector<double> response = cross[i];
    for (double& v : response) v *= constant;
    estimator.add(force[i], response);
  }
  ModalFitOptions options;
  options.low = low;
  options.high = high;
  options.max_modes = max_modes;
  options.unit_static_gain = true;
  return fitModes(estimator.h1("1"), options).model;
}

}  // namespace smartmill::kalman
