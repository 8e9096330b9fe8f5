#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <set>

#include <Eigen/Core>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

constexpr double MIN_CHI2_GAIN = 9.0;   // [1] decrease of chi squared that proves a linear reciprocal
constexpr double LENGTH_MARGIN = 2e-3;  // [m] validity of the constants beyond the measured lengths
constexpr const char* FORMAT = "smartmill-spindle-sensor/1";

ModalModel ideal() {
  ModalModel model;
  model.direct = 1.0;
  return model;
}

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
    line.slope_std = 0.0;
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
  double chi2 = 0.0;
  for (const auto& [length, value, weight] : points)
    chi2 += weight * std::pow(value - line.slope * length - line.offset, 2);
  return {line, chi2};
}

/// Constant over length: linear, unless measurements at three lengths or more prove a linear reciprocal.
LengthDependence lengthDependenceOf(const std::vector<ConstantsAtLength>& lengths, int row, int column) {
  const auto [line, chi2] = fitLine(lengths, row, column, false);
  if (lengths.size() < 3) return line;
  const auto [beam, beam_chi2] = fitLine(lengths, row, column, true);
  return chi2 - beam_chi2 > MIN_CHI2_GAIN ? beam : line;
}

/// Cross-talk that is significant at every length.
std::optional<LengthDependence> crossTalkOf(const std::vector<ConstantsAtLength>& lengths, int row,
                                            int column) {
  for (const ConstantsAtLength& l : lengths) {
    if (!(std::abs(l.share[row][column]) > 2.0 * l.std_dev[row][column])) return {};
  }
  return lengthDependenceOf(lengths, row, column);
}

LengthDependence readLengthDependence(const StrictYaml& yaml) {
  LengthDependence line;
  line.slope = yaml.number("slope_per_mm") / units::MM;
  line.offset = yaml.number("offset");
  if (yaml.has("line_of")) line.reciprocal = yaml.oneOf("line_of", {"constant", "share"}) == "share";
  if (const auto s = yaml.optionalNumber("slope_per_mm_std", Range::notNegative()))
    line.slope_std = *s / units::MM;
  if (const auto s = yaml.optionalNumber("offset_std", Range::notNegative())) line.offset_std = *s;
  yaml.finish();
  return line;
}

std::string text(const std::string& key, const LengthDependence& line) {
  std::string out =
      key + ": {slope_per_mm: " + yamlNumber(line.slope * units::MM) + ", offset: " + yamlNumber(line.offset);
  if (std::isfinite(line.slope_std)) out += ", slope_per_mm_std: " + yamlNumber(line.slope_std * units::MM);
  if (std::isfinite(line.offset_std)) out += ", offset_std: " + yamlNumber(line.offset_std);
  return out + (line.reciprocal ? ", line_of: share}\n" : "}\n");
}

ModalModel readDynamics(const StrictYaml& yaml) {
  ModalModel model = ideal();
  for (const StrictYaml& entry : yaml.maps("modes")) {
    Mode mode;
    mode.frequency = entry.number("frequency_hz", Range::positive());
    mode.damping_ratio = entry.number("damping_ratio", {0.0, 1.0, true, true});
    mode.gain = entry.number("gain");
    entry.finish();
    model.direct -= mode.gain;
    model.modes.push_back(mode);
  }
  yaml.finish();
  return model;
}

std::string text(const std::string& key, const ModalModel& model) {
  if (model.modes.empty()) return "";
  std::string out = key + ":\n  modes:\n";
  for (const Mode& mode : model.modes) {
    out += "  - {frequency_hz: " + yamlNumber(mode.frequency) +
           ", damping_ratio: " + yamlNumber(mode.damping_ratio) + ", gain: " + yamlNumber(mode.gain) + "}\n";
  }
  return out;
}

}  // namespace

SpindleSensorCalibration::SpindleSensorCalibration()
    : dynamic_yx(ideal()), dynamic_yz(ideal()), dynamic_xz(ideal()) {
}

SpindleSensorCalibration SpindleSensorCalibration::table3() {
  SpindleSensorCalibration table;
  const auto line = [](double slope_per_mm, double offset) {
    LengthDependence l;
    l.slope = slope_per_mm / units::MM;
    l.offset = offset;
    return l;
  };
  table.x = line(-0.059, 26.203);
  table.y = line(-0.063, 26.718);
  table.z = line(0.0, 62.46);
  table.yx = line(-0.121, 44.545);
  table.yz = line(-0.398, 186.16);
  table.xz = line(1.840, -597.73);
  table.preload = {6050.0, 6040.0, 6050.0, 6045.0, 6035.0, 6034.0};
  table.range_limit = 36e3;
  return table;
}

void SpindleSensorCalibration::validate() const {
  const auto check = [](const std::string& key, const LengthDependence& line) {
    require((key + ".slope").c_str(), line.slope, Range{});
    require((key + ".offset").c_str(), line.offset, Range{});
  };
  check("x", x);
  check("y", y);
  check("z", z);
  if (yx) check("yx", *yx);
  if (yz) check("yz", *yz);
  if (xz) check("xz", *xz);
  for (const double p : preload) require("preload_n", p, Range::positive());
  require("least_compression_n", least_compression, Range::notNegative());
  if (!(range_limit > 0.0)) throw Error("range_limit_n: expected above 0 N");  // may be infinite
  require("low_pass_hz", low_pass, Range::notNegative());
  require("drift_std_n_per_s", drift_std, Range::positive());
}

void SpindleSensorCalibration::checkLength(double length) const {
  if (length >= lengths[0] && length <= lengths[1]) return;
  throw Error(formatted("%.1f mm of tool and holder is outside the calibrated %.1f .. %.1f mm",
                        length / units::MM, lengths[0] / units::MM, lengths[1] / units::MM));
}

std::array<double, 3> pairMeans(const std::array<double, 6>& s) {
  return {0.5 * (s[0] - s[1]), -0.5 * (s[2] - s[3]), 0.5 * (s[4] + s[5])};
}

std::array<double, 3> staticForce(const SpindleSensorCalibration& c, double length,
                                  const std::array<double, 3>& means) {
  const double y = means[1] * c.y.at(length);
  const double x = (means[0] - (c.yx ? y / c.yx->at(length) : 0.0)) * c.x.at(length);
  const double z =
      (means[2] - (c.yz ? y / c.yz->at(length) : 0.0) - (c.xz ? x / c.xz->at(length) : 0.0)) * c.z.at(length);
  return {x, y, z};
}

double lateralLimit(const SpindleSensorCalibration& c, double length, std::size_t axis) {
  const double constant = std::abs(axis == 0 ? c.x.at(length) : c.y.at(length));
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 2 * axis; k < 2 * axis + 2; ++k) {
    least = std::min({least, c.preload[k] - c.least_compression, c.range_limit - c.preload[k]});
  }
  return least * constant;
}

SpindleSensorCalibration readSpindleSensor(const std::string& file) {
  const StrictYaml yaml = StrictYaml::fromFile(file);
  yaml.oneOf("format", {FORMAT});
  SpindleSensorCalibration c;
  c.x = readLengthDependence(yaml.map("x"));
  c.y = readLengthDependence(yaml.map("y"));
  c.z = readLengthDependence(yaml.map("z"));
  const auto cross = [&](const char* key, std::optional<LengthDependence>& line, ModalModel& dynamics) {
    if (const auto map = yaml.optionalMap(key)) line = readLengthDependence(*map);
    const std::string dynamic = std::string("dynamic_") + key;
    if (const auto map = yaml.optionalMap(dynamic)) {
      if (!line) yaml.fail(dynamic, "expected a static cross-talk " + std::string(key));
      dynamics = readDynamics(*map);
    }
  };
  cross("yx", c.yx, c.dynamic_yx);
  cross("yz", c.yz, c.dynamic_yz);
  cross("xz", c.xz, c.dynamic_xz);
  if (yaml.has("length_mm")) {
    const auto lengths = yaml.numbers("length_mm", 2, Range::positive());
    c.lengths = {lengths[0] * units::MM, lengths[1] * units::MM};
  }
  const auto preload = yaml.numbers("preload_n", 6, Range::positive());
  std::copy(preload.begin(), preload.end(), c.preload.begin());
  c.least_compression = yaml.optionalNumber("least_compression_n", Range::notNegative()).value_or(0.0);
  c.range_limit = yaml.optionalNumber("range_limit_n", Range::positive()).value_or(c.range_limit);
  c.low_pass = yaml.optionalNumber("low_pass_hz", Range::notNegative()).value_or(0.0);
  c.drift_std = yaml.optionalNumber("drift_std_n_per_s", Range::positive()).value_or(c.drift_std);
  if (const auto map = yaml.optionalMap("unbalance")) {
    const auto re = map->numbers("cos_kg_m", 3), im = map->numbers("sin_kg_m", 3);
    const auto std_dev = map->numbers("std_kg_m", 3, Range::notNegative());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      c.unbalance[axis] = {re[axis], -im[axis]};
      c.unbalance_std[axis] = std_dev[axis];
    }
    map->finish();
  }
  yaml.finish();
  try {
    c.validate();
  } catch (const Error& e) {
    throw Error(file + ": " + e.what());
  }
  return c;
}

void writeSpindleSensor(const SpindleSensorCalibration& c, const std::string& file) {
  const auto list = [](const char* key, auto begin, auto end, auto value) {
    std::string out = std::string(key) + ": [";
    for (auto it = begin; it != end; ++it) out += (it == begin ? "" : ", ") + yamlNumber(value(*it));
    return out + "]";
  };
  const auto same = [](double v) { return v; };
  std::string out = std::string("format: ") + FORMAT + "\n# constants over the length of tool and holder\n";
  out += text("x", c.x) + text("y", c.y) + text("z", c.z);
  if (c.yx) out += text("yx", *c.yx) + text("dynamic_yx", c.dynamic_yx);
  if (c.yz) out += text("yz", *c.yz) + text("dynamic_yz", c.dynamic_yz);
  if (c.xz) out += text("xz", *c.xz) + text("dynamic_xz", c.dynamic_xz);
  if (std::isfinite(c.lengths[1])) {
    out += "# valid range, length of tool and holder\n" +
           list("length_mm", c.lengths.begin(), c.lengths.end(), [](double l) { return l / units::MM; }) +
           "\n";
  }
  out += "# of x1 x2 y1 y2 z1 z2\n" + list("preload_n", c.preload.begin(), c.preload.end(), same) + "\n";
  out += "least_compression_n: " + yamlNumber(c.least_compression) + "\n";
  if (std::isfinite(c.range_limit)) out += "range_limit_n: " + yamlNumber(c.range_limit) + "\n";
  out += "low_pass_hz: " + yamlNumber(c.low_pass) + "\n";
  out += "drift_std_n_per_s: " + yamlNumber(c.drift_std) + "\n";
  if (*std::max_element(c.unbalance_std.begin(), c.unbalance_std.end()) > 0.0) {
    const auto& u = c.unbalance;
    out +=
        "# F = (cos_kg_m cos(angle) + sin_kg_m sin(angle)) w^2, angle and speed w of the "
        "spindle\nunbalance:\n";
    out += "  " + list("cos_kg_m", u.begin(), u.end(), [](auto v) { return v.real(); }) + "\n";
    out += "  " + list("sin_kg_m", u.begin(), u.end(), [](auto v) { return -v.imag(); }) + "\n";
    out += "  " + list("std_kg_m", c.unbalance_std.begin(), c.unbalance_std.end(), same) + "\n";
  }
  std::ofstream stream(file);
  stream << out;
  stream.close();
  if (!stream) throw Error(file + ": cannot write");
}

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
                                  const SpindleSensorCalibration& base) {
  const std::set<double> lengths(measurements.length.begin(), measurements.length.end());
  if (lengths.empty()) throw Error(measurements.file + ": no measurements");
  StaticCalibration result;
  result.calibration = base;
  for (const double length : lengths) result.lengths.push_back(constantsOf(measurements, length));
  for (const ConstantsAtLength& l : result.lengths) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!(std::abs(l.share[axis][axis]) > 2.0 * l.std_dev[axis][axis])) {
        throw Error(measurements.file + ": length " + std::to_string(l.length / units::MM) + " mm: pair " +
                    AXIS_NAMES[static_cast<std::size_t>(axis)] + " does not respond to its load");
      }
    }
  }
  result.calibration.lengths = {*lengths.begin() - LENGTH_MARGIN, *lengths.rbegin() + LENGTH_MARGIN};
  result.calibration.x = lengthDependenceOf(result.lengths, 0, 0);
  result.calibration.y = lengthDependenceOf(result.lengths, 1, 1);
  result.calibration.z = lengthDependenceOf(result.lengths, 2, 2);
  result.calibration.yx = crossTalkOf(result.lengths, 0, 1);
  result.calibration.yz = crossTalkOf(result.lengths, 2, 1);
  result.calibration.xz = crossTalkOf(result.lengths, 2, 0);
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
