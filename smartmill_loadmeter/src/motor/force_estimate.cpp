#include "smartmill_loadmeter/motor/force_estimate.h"

#include <algorithm>
#include <cmath>
#include <functional>

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

// Tangential coefficients of any metal: nothing is said but their size (N/m2, N/m).
constexpr double KTC = 1.5e9, KTC_STD = 1.5e9, KTE = 2.5e4, KTE_STD = 2.5e4;
constexpr int ANGLES = 64;  // over a tooth

/// What a cut's coefficients make: linear in the mean, quadratic in the variance over a tooth.
class Mechanics {
 public:
  explicit Mechanics(const ForceReadings& r) {
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
    for (Matrix6& q : variance_) q.setZero();
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
    for (const auto& at : all) {
      for (int a = 0; a < 3; ++a) {
        const Vector6 away = (at - own_mean).row(a).transpose();
        variance_[static_cast<std::size_t>(a)] += away * away.transpose() / ANGLES;
      }
    }
  }

  /// Mean force X, Y, Z [N], torque [N m], root mean square of X, Y, Z [N].
  Eigen::Matrix<double, 7, 1> of(const Eigen::VectorXd& at) const {
    Vector6 k;
    k << at[0] * KTC, at[0] * KTC * at[1], at[0] * KTC * at[2], at[3] * KTE, at[3] * KTE * at[4],
        at[3] * KTE * at[5];
    Eigen::Matrix<double, 7, 1> all;
    all.head<4>() = mean_ * k;
    for (int a = 0; a < 3; ++a)
      all[4 + a] = std::sqrt(std::max(1e-12, k.dot(variance_[static_cast<std::size_t>(a)] * k)));
    return all;
  }

 private:
  Eigen::Matrix<double, 4, 6> mean_;
  std::array<Matrix6, 3> variance_;
};

/// Readings as rows: which of Mechanics' seven, its value and its whole standard deviation.
struct Row {
  int quantity;
  double value, std_dev;
};

class Rows {
 public:
  std::vector<Row> rows;
  std::vector<std::string> sources;

  /// @param share of the value that the sensor may be wrong by @param size [N, N m] that such a share is of
  void add(const std::string& source, int quantity, const std::optional<Estimate>& e, double share,
           double size, double zero = 0.0) {
    if (!e) return;
    if (!(e->std_dev >= 0.0) || !std::isfinite(e->value)) {
      throw Error("force of a cut: the reading of " + source + " has no value or no standard deviation");
    }
    const double all = std::hypot(std::hypot(e->std_dev, share * size), zero);
    if (!(all > 0.0)) throw Error("force of a cut: the reading of " + source + " has no standard deviation");
    rows.push_back({quantity, e->value, all});
    if (sources.empty() || sources.back() != source) sources.push_back(source);
  }
};

double sizeOf(const std::array<std::optional<Estimate>, 3>& force) {
  double size = 0.0;
  for (const auto& f : force) size = std::max(size, f ? std::abs(f->value) : 0.0);
  return size;
}

Rows rowsOf(const ForceReadings& r, const ForceEstimateParameters& p) {
  Rows rows;
  const double model = p.model_error, motor = std::hypot(model, p.motor_error),
               sensor = std::hypot(model, p.sensor_error);
  const auto own = [](const std::optional<Estimate>& e) { return e ? std::abs(e->value) : 0.0; };
  rows.add("load_meter", 3, r.load_torque, model, own(r.load_torque));
  rows.add("motor_spindle", 3, r.motor_torque, motor, own(r.motor_torque));
  for (int a = 0; a < 3; ++a) {
    const auto i = static_cast<std::size_t>(a);
    rows.add(std::string("motor_") + "xyz"[i], a, r.motor_force[i], motor, own(r.motor_force[i]));
  }
  // Cross-talk leaves shares of the largest component in the others.
  for (int a = 0; a < 3; ++a) {
    const auto i = static_cast<std::size_t>(a);
    rows.add("sensor", a, r.sensor_force[i], sensor, sizeOf(r.sensor_force), p.sensor_zero);
    rows.add("sensor", 4 + a, r.sensor_rms[i], sensor, sizeOf(r.sensor_rms));
  }
  if (rows.rows.empty()) throw Error("force of a cut: no sensor says anything");
  return rows;
}

/// The coefficients (Ktc, ratios, Kte, ratios; in units of the prior's sizes) that readings and prior like
/// best.
Eigen::VectorXd solve(const Mechanics& mechanics, const std::vector<Row>& rows,
                      const std::array<double, 6>& prior, const std::array<double, 6>& scatter,
                      double* squares) {
  const auto count = static_cast<Eigen::Index>(rows.size());
  const fit::FunctionResiduals residuals(count + 6, [&](const Eigen::VectorXd& at, Eigen::VectorXd& out) {
    const auto due = mechanics.of(at);
    for (Eigen::Index i = 0; i < count; ++i) {
      const Row& row = rows[static_cast<std::size_t>(i)];
      out[i] = (due[row.quantity] - row.value) / row.std_dev;
    }
    for (Eigen::Index c = 0; c < 6; ++c) {
      const auto j = static_cast<std::size_t>(c);
      out[count + c] = (at[c] - prior[j]) / scatter[j];
    }
  });
  std::vector<fit::Parameter> start;
  for (std::size_t c = 0; c < 6; ++c) {
    fit::Parameter one;
    one.start = prior[c];
    one.scale = scatter[c];
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
  table.number("radial_ratio", radial_ratio, "1", Range::closed(0.0, 2.0), "Krc over Ktc of metals");
  table.number("radial_ratio_std", radial_ratio_std, "1", Range::openLow(0.0, 2.0), "its scatter");
  table.number("axial_ratio", axial_ratio, "1", Range::closed(-1.0, 2.0), "Kac over Ktc");
  table.number("axial_ratio_std", axial_ratio_std, "1", Range::openLow(0.0, 2.0), "its scatter");
  table.number("radial_edge_ratio", radial_edge_ratio, "1", Range::closed(0.0, 5.0), "Kre over Kte");
  table.number("radial_edge_ratio_std", radial_edge_ratio_std, "1", Range::openLow(0.0, 5.0), "its scatter");
  table.number("axial_edge_ratio", axial_edge_ratio, "1", Range::closed(-2.0, 5.0), "Kae over Kte");
  table.number("axial_edge_ratio_std", axial_edge_ratio_std, "1", Range::openLow(0.0, 5.0), "its scatter");
  table.number("model_error", model_error, "1", Range::closed(0.0, 0.5),
               "share of a reading by which the cut's mechanics may miss it");
  table.number("motor_error", motor_error, "1", Range::closed(0.0, 0.5),
               "share by which a motor's constant may have moved since its calibration (warmth)");
  table.number("sensor_error", sensor_error, "1", Range::closed(0.0, 0.5),
               "share of the largest component by which a force sensor may be wrong (gain, cross-talk)");
  table.number("sensor_zero", sensor_zero, "N", Range::closed(0.0, 1000.0),
               "by which its zero may have moved");
  table.number("period", period, "s", Range::closed(0.0, 10.0),
               "between estimates while a cut is steady; 0: one a cut, at its end");
  table.number(
      "window", window, "s", Range::closed(0.05, 60.0),
      "that such an estimate looks back; a drive whose current turns less than twice in it says nothing");
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

/// One reading of each drive. @param squares becomes its distance from prior and mechanics
ForceEstimate estimateOne(const ForceReadings& readings, const ForceEstimateParameters& p, double* squares) {
  const Rows rows = rowsOf(readings, p);
  const Mechanics mechanics(readings);
  const std::array<double, 6> prior{
      {1.0, p.radial_ratio, p.axial_ratio, 1.0, p.radial_edge_ratio, p.axial_edge_ratio}};
  const std::array<double, 6> scatter{{KTC_STD / KTC, p.radial_ratio_std, p.axial_ratio_std, KTE_STD / KTE,
                                       p.radial_edge_ratio_std, p.axial_edge_ratio_std}};
  const auto count = static_cast<Eigen::Index>(rows.rows.size());
  const Eigen::VectorXd at = solve(mechanics, rows.rows, prior, scatter, squares);
  ForceEstimate found;
  found.stamp = readings.stamp;
  found.name = readings.name;
  found.sources = rows.sources;
  const auto best = mechanics.of(at);
  Eigen::Matrix<double, 7, 6> slope;
  for (Eigen::Index c = 0; c < 6; ++c) {
    const double step = 1e-4 * scatter[static_cast<std::size_t>(c)];
    Eigen::VectorXd up = at, down = at;
    up[c] += step;
    down[c] -= step;
    slope.col(c) = (mechanics.of(up) - mechanics.of(down)) / (2.0 * step);
  }
  // What readings and prior tell together; a bound says nothing.
  Matrix6 information = Matrix6::Zero();
  for (Eigen::Index c = 0; c < 6; ++c) information(c, c) = std::pow(scatter[static_cast<std::size_t>(c)], -2);
  for (const Row& row : rows.rows)
    information +=
        slope.row(row.quantity).transpose() * slope.row(row.quantity) / (row.std_dev * row.std_dev);
  const Matrix6 covariance = linear::inverseSymmetric(Eigen::MatrixXd(information));
  const Eigen::Matrix<double, 7, 7> spread = slope * covariance * slope.transpose();
  const auto estimate = [&](Eigen::Index i) {
    return Estimate{best[i], std::sqrt(std::max(0.0, spread(i, i)))};
  };
  for (Eigen::Index a = 0; a < 3; ++a) {
    found.mean[static_cast<std::size_t>(a)] = estimate(a);
    found.rms[static_cast<std::size_t>(a)] = estimate(4 + a);
  }
  found.torque = estimate(3);
  for (const Row& row : rows.rows)
    found.surprise +=
        std::pow((best[row.quantity] - row.value) / row.std_dev, 2) / static_cast<double>(count);
  return found;
}

/// Several estimates as one: mean and spread of a mixture.
Estimate mixed(const std::vector<ForceEstimate>& all, const std::vector<double>& weight,
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

ForceEstimate estimateForce(const ForceReadings& readings, const ForceEstimateParameters& p) {
  std::vector<ForceReadings> variants{readings};
  for (std::size_t a = 0; a < 3; ++a) {
    if (!readings.motor_force[a] || !readings.motor_other[a]) continue;
    for (std::size_t i = variants.size(); i-- > 0;) {
      variants.push_back(variants[i]);
      variants.back().motor_force[a] = readings.motor_other[a];
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
    found.mean[a] = mixed(all, weight, [a](const ForceEstimate& e) -> const Estimate& { return e.mean[a]; });
    found.rms[a] = mixed(all, weight, [a](const ForceEstimate& e) -> const Estimate& { return e.rms[a]; });
  }
  found.torque = mixed(all, weight, [](const ForceEstimate& e) -> const Estimate& { return e.torque; });
  return found;
}

}  // namespace smartmill::loadmeter
