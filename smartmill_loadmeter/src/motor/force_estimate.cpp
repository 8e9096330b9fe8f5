#include "smartmill_loadmeter/motor/force_estimate.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/Core>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Prior of the tangential coefficients of metals, wide on purpose (N/m2, N/m).
constexpr double KTC = 1.5e9, KTC_STD = 1.5e9, KTE = 2.5e4, KTE_STD = 2.5e4;
constexpr int ANGLES = 64;  // per tooth period
// Quantities of the mechanics: mean force X, Y, Z, torque, RMS of X, Y, Z, then the squared amplitudes of the
// tooth passing harmonics of each axis.
constexpr int RMS = 4, LINES = 7, QUANTITIES = LINES + 3 * TOOTH_HARMONICS;
constexpr Eigen::Index COEFFICIENTS = 6;
constexpr Estimate NOT_MEASURED{std::numeric_limits<double>::quiet_NaN(),
                                std::numeric_limits<double>::quiet_NaN()};

int lineOf(int axis, int tooth) {
  return LINES + axis * TOOTH_HARMONICS + tooth - 1;
}

/// Forces as functions of the coefficients: linear in the mean, quadratic in the variance over a tooth
/// period.
class CutMechanics {
 public:
  explicit CutMechanics(const CutMeasurements& r) {
    const auto map = meanForceMatrix(r.tool, r.engagement);
    Eigen::Matrix<double, 4, 6> own;
    for (int f = 0; f < 4; ++f) {
      for (int c = 0; c < 6; ++c) own(f, c) = map[static_cast<std::size_t>(f)][static_cast<std::size_t>(c)];
    }
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    turn.topLeftCorner<2, 2>() << std::cos(r.heading), -std::sin(r.heading), std::sin(r.heading),
        std::cos(r.heading);
    mean_.topRows<3>() = turn * own.topRows<3>();
    mean_.row(3) = own.row(3);
    for (Matrix6& q : squares_) q.setZero();
    std::vector<MechanisticForce> units;
    for (const CuttingKey& key : cuttingKeys()) {
      CuttingCoefficients one{0, 0, 0, 0, 0, 0};
      one.*key.coefficient = 1.0;
      units.emplace_back(r.tool, one, r.engagement);
    }
    Eigen::Matrix<double, 3, 6> own_mean = Eigen::Matrix<double, 3, 6>::Zero();
    std::vector<Eigen::Matrix<double, 3, 6>> all;
    for (int i = 0; i < ANGLES; ++i) {
      const double angle = units::TWO_PI / r.tool.teeth * (i + 0.5) / ANGLES;
      Eigen::Matrix<double, 3, 6> at;
      for (int c = 0; c < 6; ++c) {
        const CuttingForce f = units[static_cast<std::size_t>(c)].at(angle);
        at.col(c) = Eigen::Vector3d(f.fx, f.fy, f.fz);
      }
      all.push_back(turn * at);
      own_mean += all.back() / ANGLES;
    }
    for (int a = 0; a < 3; ++a) addSquares(all, own_mean, a);
  }

  /// [N], [N m], [N2]
  Eigen::VectorXd of(const Eigen::VectorXd& at) const {
    Vector6 k;
    k << at[0] * KTC, at[0] * KTC * at[1], at[0] * KTC * at[2], at[3] * KTE, at[3] * KTE * at[4],
        at[3] * KTE * at[5];
    Eigen::VectorXd all(QUANTITIES);
    all.head<4>() = mean_ * k;
    for (int q = RMS; q < QUANTITIES; ++q) {
      const double square = std::max(1e-12, k.dot(squares_[static_cast<std::size_t>(q - RMS)] * k));
      all[q] = q < LINES ? std::sqrt(square) : square;
    }
    return all;
  }

 private:
  using Unit = Eigen::Matrix<double, 3, 6>;  // force per coefficient

  // Variance of an axis over a tooth period and squared amplitudes of its harmonics.
  void addSquares(const std::vector<Unit>& all, const Unit& mean, int axis) {
    const auto square = [this](int quantity) -> Matrix6& {
      return squares_[static_cast<std::size_t>(quantity - RMS)];
    };
    std::array<Vector6, 2 * TOOTH_HARMONICS> parts;
    for (Vector6& part : parts) part.setZero();
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Vector6 away = (all[i] - mean).row(axis).transpose();
      square(RMS + axis) += away * away.transpose() / ANGLES;
      for (std::size_t k = 0; k < TOOTH_HARMONICS; ++k) {
        const double turned = units::TWO_PI * static_cast<double>((k + 1) * i) / ANGLES;
        parts[2 * k] += 2.0 / ANGLES * std::cos(turned) * away;
        parts[2 * k + 1] += 2.0 / ANGLES * std::sin(turned) * away;
      }
    }
    for (int k = 0; k < 2 * TOOTH_HARMONICS; ++k) {
      const Vector6& part = parts[static_cast<std::size_t>(k)];
      square(lineOf(axis, 1 + k / 2)) += part * part.transpose();
    }
  }

  Eigen::Matrix<double, 4, 6> mean_;
  std::array<Matrix6, QUANTITIES - RMS> squares_;  // quadratic forms of the variations
};

/// Measurement: quantity of CutMechanics, value and total standard deviation.
struct Observation {
  int quantity;
  double value, std_dev;
  int drive = -1;  // axis of the drive whose motor constant and lag are unknowns; -1: none
  LagResponse lagResponse{};

  bool isLine() const { return quantity >= LINES; }
};

/// Unknowns in addition to the coefficients: for each drive with lines, the logarithms of its motor constant
/// and bandwidth over their standard deviations.
struct Drives {
  std::array<Eigen::Index, 3> at{{-1, -1, -1}};
  std::array<double, 3> gain_std{}, lag_std{};
  Eigen::Index count = 0;

  double predicted(const Observation& row, const Eigen::VectorXd& expected,
                   const Eigen::VectorXd& unknowns) const {
    const double value = expected[row.quantity];
    if (row.drive < 0) return value;
    const auto axis = static_cast<std::size_t>(row.drive);
    const double gain = gain_std[axis] * unknowns[at[axis]];
    if (!row.isLine()) return value * std::exp(gain);
    const double lag = row.lagResponse.slope * lag_std[axis] * unknowns[at[axis] + 1];
    return value * std::pow(row.lagResponse.gain, 2) * std::exp(2.0 * (gain + lag));
  }
};

class Observations {
 public:
  std::vector<Observation> rows;
  std::vector<std::string> sources;
  Drives drives;

  /// @param share relative systematic error of the sensor. @param size [N, N m] to which the share applies
  void add(const std::string& source, int quantity, const std::optional<Estimate>& e, double share,
           double size, double zero = 0.0) {
    if (!e) return;
    if (!(e->std_dev >= 0.0) || !std::isfinite(e->value)) {
      throw Error("force of a cut: measurement of " + source +
                  ": expected a finite value and a standard deviation");
    }
    const double all = std::hypot(std::hypot(e->std_dev, share * size), zero);
    if (!(all > 0.0))
      throw Error("force of a cut: measurement of " + source + ": expected a standard deviation > 0");
    rows.push_back({quantity, e->value, all, -1, {}});
    if (sources.empty() || sources.back() != source) sources.push_back(source);
  }

  /// Adds the lines of the drive whose mean was added last.
  void addLines(int axis, const std::vector<SpectralLine>& lines, const Estimate& bandwidth,
                const ForceEstimateParameters& p) {
    const auto i = static_cast<std::size_t>(axis);
    drives.at[i] = COEFFICIENTS + drives.count;
    drives.count += 2;
    drives.gain_std[i] = std::max(1e-4, p.motor_error);
    drives.lag_std[i] = std::max(1e-4, bandwidth.std_dev / bandwidth.value);
    rows.back().drive = axis;
    for (const SpectralLine& line : lines) {
      if (line.tooth < 1 || line.tooth > TOOTH_HARMONICS) continue;
      const double all = std::hypot(line.power_std, 2.0 * p.model_error * std::max(0.0, line.power));
      if (!(all > 0.0) || !std::isfinite(line.power)) continue;
      rows.push_back(
          {lineOf(axis, line.tooth), line.power, all, axis, lagResponse(line.frequency, bandwidth.value)});
    }
  }
};

double sizeOf(const std::array<std::optional<Estimate>, 3>& force) {
  double size = 0.0;
  for (const auto& f : force) size = std::max(size, f ? std::abs(f->value) : 0.0);
  return size;
}

Observations observationsOf(const CutMeasurements& r, const ForceEstimateParameters& p) {
  Observations rows;
  const double model = p.model_error, motor = std::hypot(model, p.motor_error),
               sensor = std::hypot(model, p.sensor_error);
  const auto own = [](const std::optional<Estimate>& e) { return e ? std::abs(e->value) : 0.0; };
  rows.add("load_meter", 3, r.load_torque, model, own(r.load_torque));
  rows.add("motor_spindle", 3, r.motor_torque, motor, own(r.motor_torque));
  for (int a = 0; a < 3; ++a) {
    const auto i = static_cast<std::size_t>(a);
    const bool varies = r.motor_force[i] && r.bandwidth[i] && !r.motor_lines[i].empty();
    rows.add(std::string("motor_") + "xyz"[i], a, r.motor_force[i], varies ? model : motor,
             own(r.motor_force[i]));
    if (varies) rows.addLines(a, r.motor_lines[i], *r.bandwidth[i], p);
  }
  // Cross-talk adds shares of the largest component to the others.
  for (int a = 0; a < 3; ++a) {
    const auto i = static_cast<std::size_t>(a);
    rows.add("sensor", a, r.sensor_force[i], sensor, sizeOf(r.sensor_force), p.sensor_zero);
    rows.add("sensor", 4 + a, r.sensor_rms[i], sensor, sizeOf(r.sensor_rms));
  }
  if (rows.rows.empty()) throw Error("force of a cut: no measurement");
  return rows;
}

/// Prior of the unknowns: coefficients (Ktc, ratios, Kte, ratios, in units of the prior's values) and drives.
struct Prior {
  Eigen::VectorXd value, scatter;

  Prior(const ForceEstimateParameters& p, const Drives& drives)
      : value(Eigen::VectorXd::Zero(COEFFICIENTS + drives.count)),
        scatter(Eigen::VectorXd::Ones(COEFFICIENTS + drives.count)) {
    value.head<6>() << 1.0, p.radial_ratio, p.axial_ratio, 1.0, p.radial_edge_ratio, p.axial_edge_ratio;
    scatter.head<6>() << KTC_STD / KTC, p.radial_ratio_std, p.axial_ratio_std, KTE_STD / KTE,
        p.radial_edge_ratio_std, p.axial_edge_ratio_std;
  }
};

/// Maximum a posteriori estimate of the unknowns.
Eigen::VectorXd solve(const CutMechanics& mechanics, const Observations& rows, const Prior& prior,
                      double* squares) {
  const auto count = static_cast<Eigen::Index>(rows.rows.size()), unknowns = prior.value.size();
  const fit::FunctionResiduals residuals(
      count + unknowns, [&](const Eigen::VectorXd& at, Eigen::VectorXd& out) {
        const Eigen::VectorXd expected = mechanics.of(at);
        for (Eigen::Index i = 0; i < count; ++i) {
          const Observation& row = rows.rows[static_cast<std::size_t>(i)];
          out[i] = (rows.drives.predicted(row, expected, at) - row.value) / row.std_dev;
        }
        out.tail(unknowns) = (at - prior.value).cwiseQuotient(prior.scatter);
      });
  std::vector<fit::Parameter> start;
  for (Eigen::Index c = 0; c < unknowns; ++c) {
    fit::Parameter one;
    one.start = prior.value[c];
    one.scale = prior.scatter[c];
    if (c == 0 || c == 3) one.low = 1e-3;
    start.push_back(one);
  }
  const fit::Result solved = fit::minimise(residuals, start);
  if (!solved.usable()) throw Error("force of a cut: " + solved.message);
  *squares = solved.squares;
  return solved.value;
}

}  // namespace

void ForceEstimateParameters::declare(ParameterTable& table) {
  table.number("radial_ratio", radial_ratio, "1", Range::closed(0.0, 2.0), "Krc / Ktc of metals, prior mean");
  table.number("radial_ratio_std", radial_ratio_std, "1", Range::openLow(0.0, 2.0), "its standard deviation");
  table.number("axial_ratio", axial_ratio, "1", Range::closed(-1.0, 2.0), "Kac / Ktc, prior mean");
  table.number("axial_ratio_std", axial_ratio_std, "1", Range::openLow(0.0, 2.0), "its standard deviation");
  table.number("radial_edge_ratio", radial_edge_ratio, "1", Range::closed(0.0, 5.0), "Kre / Kte, prior mean");
  table.number("radial_edge_ratio_std", radial_edge_ratio_std, "1", Range::openLow(0.0, 5.0),
               "its standard deviation");
  table.number("axial_edge_ratio", axial_edge_ratio, "1", Range::closed(-2.0, 5.0), "Kae / Kte, prior mean");
  table.number("axial_edge_ratio_std", axial_edge_ratio_std, "1", Range::openLow(0.0, 5.0),
               "its standard deviation");
  table.number("model_error", model_error, "1", Range::closed(0.0, 0.5),
               "relative error of the cut's mechanics");
  table.number("motor_error", motor_error, "1", Range::closed(0.0, 0.5),
               "relative change of a motor constant since its calibration (temperature)");
  table.number("sensor_error", sensor_error, "1", Range::closed(0.0, 0.5),
               "error of a force sensor over its largest component (gain, cross-talk)");
  table.number("sensor_zero", sensor_zero, "N", Range::closed(0.0, 1000.0),
               "drift of the force sensor's zero");
  table.number("period", period, "s", Range::closed(0.0, 10.0),
               "period of the estimates during a steady cut; 0: one per cut, at its end");
  table.number("window", window, "s", Range::closed(0.05, 60.0),
               "length of the window of these estimates; drives with less than two electrical periods in it "
               "are ignored");
}

std::string ForceEstimate::text() const {
  std::string all;
  for (std::size_t a = 0; a < 3; ++a) {
    all += formatted("F%c %.1f +- %.1f N (varies by %.1f +- %.1f), ", "xyz"[a], mean[a].value,
                     mean[a].std_dev, rms[a].value, rms[a].std_dev);
  }
  all += formatted("torque %.3f +- %.3f N m, by", torque.value, torque.std_dev);
  for (const std::string& source : sources) all += " " + source;
  return all;
}

namespace {

/// Converts a squared amplitude to an amplitude.
Estimate amplitudeOf(double square, double std_dev) {
  const double amplitude = std::sqrt(std::max(0.0, square));
  return {amplitude, std_dev / (2.0 * std::max(amplitude, std::sqrt(0.5 * std_dev + 1e-12)))};
}

/// The mechanics have no component at the spindle frequency: the drives' lines are only corrected for their
/// lag.
std::optional<ForceLine> revolutionOf(const CutMeasurements& r, const ForceEstimateParameters& p) {
  std::optional<ForceLine> found;
  for (std::size_t a = 0; a < 3; ++a) {
    if (!r.bandwidth[a]) continue;
    for (const SpectralLine& line : r.motor_lines[a]) {
      if (line.tooth != 0) continue;
      if (!found) found.emplace(ForceLine{line.frequency, {NOT_MEASURED, NOT_MEASURED, NOT_MEASURED}});
      const LagResponse h = lagResponse(line.frequency, r.bandwidth[a]->value);
      Estimate& e = found->amplitude[a] = amplitudeOf(line.power, line.power_std);
      const double share =
          std::hypot(p.motor_error, h.slope * r.bandwidth[a]->std_dev / r.bandwidth[a]->value);
      e = {e.value / h.gain, std::hypot(e.std_dev, share * e.value) / h.gain};
    }
  }
  return found;
}

void addLines(const CutMeasurements& r, const ForceEstimateParameters& p, const Eigen::VectorXd& best,
              const Eigen::MatrixXd& spread, ForceEstimate* found) {
  if (!(r.spindle_speed > 0.0)) return;
  if (const auto revolution = revolutionOf(r, p)) found->lines.push_back(*revolution);
  for (const SpectralLine& known : cutLines(r.spindle_speed, r.tool.teeth)) {
    if (known.tooth == 0) continue;
    ForceLine line;
    line.frequency = known.frequency;
    for (int a = 0; a < 3; ++a) {
      const Eigen::Index q = lineOf(a, known.tooth);
      line.amplitude[static_cast<std::size_t>(a)] =
          amplitudeOf(best[q], std::sqrt(std::max(0.0, spread(q, q))));
    }
    found->lines.push_back(line);
  }
}

/// Estimate for one sign of each drive's force. @param squares chi2 of prior and measurements
ForceEstimate estimateOne(const CutMeasurements& measurements, const ForceEstimateParameters& p,
                          double* squares) {
  const Observations rows = observationsOf(measurements, p);
  const CutMechanics mechanics(measurements);
  const Prior prior(p, rows.drives);
  const auto count = static_cast<Eigen::Index>(rows.rows.size()), unknowns = prior.value.size();
  const Eigen::VectorXd at = solve(mechanics, rows, prior, squares);
  ForceEstimate found;
  found.stamp = measurements.stamp;
  found.name = measurements.name;
  found.sources = rows.sources;
  const auto predictedValues = [&](const Eigen::VectorXd& u) {
    const Eigen::VectorXd expected = mechanics.of(u);
    Eigen::VectorXd all(count);
    for (Eigen::Index i = 0; i < count; ++i)
      all[i] = rows.drives.predicted(rows.rows[static_cast<std::size_t>(i)], expected, u);
    return all;
  };
  const Eigen::VectorXd best = mechanics.of(at), predictions = predictedValues(at);
  Eigen::MatrixXd slope(QUANTITIES, unknowns), of_rows(count, unknowns);
  for (Eigen::Index c = 0; c < unknowns; ++c) {
    const double step = 1e-4 * prior.scatter[c];
    Eigen::VectorXd up = at, down = at;
    up[c] += step;
    down[c] -= step;
    slope.col(c) = (mechanics.of(up) - mechanics.of(down)) / (2.0 * step);
    of_rows.col(c) = (predictedValues(up) - predictedValues(down)) / (2.0 * step);
  }
  // Information of measurements and prior; bounds are ignored.
  Eigen::MatrixXd information = prior.scatter.cwiseAbs2().cwiseInverse().asDiagonal();
  for (Eigen::Index i = 0; i < count; ++i) {
    const Observation& row = rows.rows[static_cast<std::size_t>(i)];
    information += of_rows.row(i).transpose() * of_rows.row(i) / (row.std_dev * row.std_dev);
    found.chi_square += std::pow((predictions[i] - row.value) / row.std_dev, 2) / static_cast<double>(count);
  }
  const Eigen::MatrixXd covariance = linear::inverseSymmetric(information);
  const Eigen::MatrixXd spread = slope * covariance * slope.transpose();
  const auto estimate = [&](Eigen::Index i) {
    return Estimate{best[i], std::sqrt(std::max(0.0, spread(i, i)))};
  };
  for (Eigen::Index a = 0; a < 3; ++a) {
    found.mean[static_cast<std::size_t>(a)] = estimate(a);
    found.rms[static_cast<std::size_t>(a)] = estimate(RMS + a);
  }
  found.torque = estimate(3);
  addLines(measurements, p, best, spread, &found);
  return found;
}

/// Mean and standard deviation of a mixture.
Estimate mixtureOf(const std::vector<ForceEstimate>& all, const std::vector<double>& weight,
                   const std::function<const Estimate&(const ForceEstimate&)>& of) {
  Estimate sum;
  for (std::size_t i = 0; i < all.size(); ++i) sum.value += weight[i] * of(all[i]).value;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Estimate& e = of(all[i]);
    sum.std_dev += weight[i] * (e.std_dev * e.std_dev + std::pow(e.value - sum.value, 2));
  }
  sum.std_dev = std::sqrt(sum.std_dev);
  return sum;
}

}  // namespace

ForceEstimate estimateForce(const CutMeasurements& measurements, const ForceEstimateParameters& p) {
  std::vector<CutMeasurements> variants{measurements};
  for (std::size_t a = 0; a < 3; ++a) {
    if (!measurements.motor_force[a] || !measurements.motor_other[a]) continue;
    for (std::size_t i = variants.size(); i-- > 0;) {
      variants.push_back(variants[i]);
      variants.back().motor_force[a] = measurements.motor_other[a];
    }
  }
  std::vector<ForceEstimate> all;
  std::vector<double> squares(variants.size()), weight;
  for (std::size_t i = 0; i < variants.size(); ++i) all.push_back(estimateOne(variants[i], p, &squares[i]));
  const std::size_t best =
      static_cast<std::size_t>(std::min_element(squares.begin(), squares.end()) - squares.begin());
  double sum = 0.0;
  for (const double s : squares) {
    weight.push_back(std::exp(-0.5 * (s - squares[best])));
    sum += weight.back();
  }
  for (double& w : weight) w /= sum;
  ForceEstimate found = all[best];
  for (std::size_t a = 0; a < 3; ++a) {
    found.mean[a] =
        mixtureOf(all, weight, [a](const ForceEstimate& e) -> const Estimate& { return e.mean[a]; });
    found.rms[a] =
        mixtureOf(all, weight, [a](const ForceEstimate& e) -> const Estimate& { return e.rms[a]; });
  }
  found.torque = mixtureOf(all, weight, [](const ForceEstimate& e) -> const Estimate& { return e.torque; });
  return found;
}

}  // namespace smartmill::loadmeter
