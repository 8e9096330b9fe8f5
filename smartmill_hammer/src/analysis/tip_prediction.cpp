#include "tip_prediction.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/signal/statistics.h"

namespace smartmill::hammer {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Predictions of a fit: of each measured mode the direct gain and the factor, gain(tip, tip) over
/// gain(struck, read), the correction; of each other mode frequency, direct gain and added gain.
struct Predictions {
  std::vector<double> direct, factor;                                // of measured modes
  std::vector<double> frequency, unmeasured_gain, unmeasured_added;  // of the others
};

Predictions predict(const TipProblem& problem, const TipFit& fit, const VectorXd& z) {
  Predictions a;
  const std::vector<HeldMode> held = HeldTool(toolInHolder(problem, z)).modes();
  const OffsetMeasurement& at = problem.measurements.front();
  for (const std::size_t k : fit.match) {
    a.direct.push_back(held[k].gain(0.0, 0.0));
    a.factor.push_back(held[k].gain(0.0, 0.0) / problem.gainOf(held[k], at, z));
  }
  for (std::size_t k = 0; k < held.size(); ++k) {
    if (std::find(fit.match.begin(), fit.match.end(), k) != fit.match.end()) continue;
    a.frequency.push_back(held[k].frequency);
    a.unmeasured_gain.push_back(held[k].gain(0.0, 0.0));
    a.unmeasured_added.push_back(held[k].gain(0.0, 0.0) - problem.gainOf(held[k], at, z));
  }
  return a;
}

VectorXd flatten(const Predictions& a) {
  std::vector<double> all;
  for (const auto* list : {&a.direct, &a.factor, &a.frequency, &a.unmeasured_gain, &a.unmeasured_added})
    all.insert(all.end(), list->begin(), list->end());
  return Eigen::Map<const VectorXd>(all.data(), static_cast<Index>(all.size()));
}

/// Standard deviations of the predictions, from the covariance of the unknowns.
VectorXd predictionStd(const TipProblem& problem, const TipFit& fit) {
  constexpr double SPAN = 1e-4;
  const Index n = fit.z.size();
  Eigen::MatrixXd map(flatten(predict(problem, fit, fit.z)).size(), n);
  for (Index k = 0; k < n; ++k) {
    VectorXd up = fit.z, down = fit.z;
    up[k] += SPAN;
    down[k] -= SPAN;
    map.col(k) = (flatten(predict(problem, fit, up)) - flatten(predict(problem, fit, down))) / (2.0 * SPAN);
  }
  return (map * fit.covariance * map.transpose()).diagonal().cwiseMax(0.0).cwiseSqrt();
}

TipMode measuredTipMode(const TipFitOptions& options, const Mode& measured, double direct, double direct_std,
                        double factor, double factor_std) {
  TipMode tip;
  tip.direct = measured;
  tip.factor = factor;
  tip.factor_std = std::hypot(factor_std, options.model_factor * (factor - 1.0));
  // By the factor; near a node of the mode, where the factor is uncertain, by the beam.
  const double by_factor =
      std::hypot(factor * finiteOrZero(measured.gain_std), measured.gain * tip.factor_std);
  const double by_beam = std::hypot(direct_std, options.model_gain * direct);
  tip.direct.gain = by_factor <= by_beam ? measured.gain * factor : direct;
  tip.direct.gain_std = std::min(by_factor, by_beam);
  tip.added = tip.direct.gain - measured.gain;
  return tip;
}

}  // namespace

TipCorrection correctionOf(const TipProblem& problem, const TipFit& fit) {
  const Predictions a = predict(problem, fit, fit.z);
  const VectorXd std = predictionStd(problem, fit);
  const std::size_t measured = a.direct.size();
  const auto deviation = [&](std::size_t i) { return std[static_cast<Index>(i)]; };
  TipCorrection result;
  std::vector<double> damping;
  for (std::size_t r = 0; r < measured; ++r) {
    result.modes.push_back(measuredTipMode(problem.options, problem.modes()[r], a.direct[r], deviation(r),
                                           a.factor[r], deviation(measured + r)));
    damping.push_back(problem.modes()[r].damping_ratio);
  }
  const std::size_t unmeasured = a.frequency.size();
  double variance = 0.0;
  for (std::size_t k = 0; k < unmeasured; ++k) {
    TipMode tip;
    tip.measured = false;
    tip.direct = {a.frequency[k], median(damping), a.unmeasured_gain[k]};
    tip.direct.frequency_std =
        std::hypot(deviation(2 * measured + k), problem.options.model_frequency * a.frequency[k]);
    tip.direct.damping_ratio_std = problem.options.predicted_damping_std * tip.direct.damping_ratio;
    tip.direct.gain_std = std::hypot(deviation(2 * measured + unmeasured + k),
                                     problem.options.model_gain * a.unmeasured_gain[k]);
    tip.added = a.unmeasured_added[k];
    tip.factor = tip.factor_std = INFINITY;
    if (a.frequency[k] < problem.high) {
      result.modes.push_back(tip);
      continue;
    }
    tip.direct.gain_std =
        std::hypot(deviation(2 * measured + 2 * unmeasured + k), problem.options.model_gain * tip.added);
    result.beyond.push_back(tip);
    result.direct += tip.added;
    variance += tip.direct.gain_std * tip.direct.gain_std;
  }
  std::sort(result.modes.begin(), result.modes.end(),
            [](const TipMode& x, const TipMode& y) { return x.direct.frequency < y.direct.frequency; });
  result.direct_std = std::sqrt(variance);
  return result;
}

}  // namespace smartmill::hammer
