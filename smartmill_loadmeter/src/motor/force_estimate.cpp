#include "smartmill_loadmeter/motor/force_estimate.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/Core>

#include "cut_mechanics.h"
#include "force_observations.h"
#include "smartmill_core/error.h"
#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::loadmeter {

namespace {

constexpr Estimate NOT_MEASURED{std::numeric_limits<double>::quiet_NaN(),
                                std::numeric_limits<double>::quiet_NaN()};

/// Prior of the unknowns: coefficients (Ktc, ratios, Kte, ratios, in units of the prior's values) and drives.
struct Prior {
  Eigen::VectorXd value, scatter;

  Prior(const ForceEstimateParameters& p, const DriveUnknowns& drives)
      : value(Eigen::VectorXd::Zero(CutMechanics::COEFFICIENTS + drives.count)),
        scatter(Eigen::VectorXd::Ones(CutMechanics::COEFFICIENTS + drives.count)) {
    value.head<6>() << 1.0, p.radial_ratio, p.axial_ratio, 1.0, p.radial_edge_ratio, p.axial_edge_ratio;
    scatter.head<6>() << p.ktc_std / p.ktc, p.radial_ratio_std, p.axial_ratio_std, p.kte_std / p.kte,
        p.radial_edge_ratio_std, p.axial_edge_ratio_std;
  }
};

/// Maximum a posteriori estimate of the unknowns.
Eigen::VectorXd solve(const CutMechanics& mechanics, const ForceObservations& rows, const Prior& prior,
                      double* squares) {
  const auto count = static_cast<Eigen::Index>(rows.rows.size()), unknowns = prior.value.size();
  const fit::FunctionResiduals residuals(
      count + unknowns, [&](const Eigen::VectorXd& at, Eigen::VectorXd& out) {
        const Eigen::VectorXd expected = mechanics.of(at);
        for (Eigen::Index i = 0; i < count; ++i) {
          const ForceObservation& row = rows.rows[static_cast<std::size_t>(i)];
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
    all += formatted("F%c %.1f +- %.1f N", "xyz"[a], mean[a].value, mean[a].std_dev);
    if (std::isfinite(rms[a].value))
      all += formatted(" (varies by %.1f +- %.1f)", rms[a].value, rms[a].std_dev);
    all += ", ";
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
  if (!(r.spindle_speed > 0.0) || r.tool.teeth == 0) return;
  if (const auto revolution = revolutionOf(r, p)) found->lines.push_back(*revolution);
  for (const SpectralLine& known : cutLines(r.spindle_speed, r.tool.teeth)) {
    if (known.tooth == 0) continue;
    ForceLine line;
    line.frequency = known.frequency;
    for (int a = 0; a < 3; ++a) {
      const Eigen::Index q = CutMechanics::lineOf(a, known.tooth);
      line.amplitude[static_cast<std::size_t>(a)] =
          amplitudeOf(best[q], std::sqrt(std::max(0.0, spread(q, q))));
    }
    found->lines.push_back(line);
  }
}

/// Estimate for one sign of each drive's force. @param squares chi2 of prior and measurements
ForceEstimate estimateOne(const CutMeasurements& measurements, const ForceEstimateParameters& p,
                          double* squares) {
  const ForceObservations rows = observationsOf(measurements, p);
  const CutMechanics mechanics(measurements, p);
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
  Eigen::MatrixXd slope(CutMechanics::QUANTITIES, unknowns), of_rows(count, unknowns);
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
    const ForceObservation& row = rows.rows[static_cast<std::size_t>(i)];
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
    found.rms[static_cast<std::size_t>(a)] =
        measurements.tool.teeth > 0 ? estimate(CutMechanics::RMS + a) : NOT_MEASURED;
  }
  found.torque = estimate(CutMechanics::TORQUE);
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
