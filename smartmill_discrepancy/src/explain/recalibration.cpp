#include "smartmill_discrepancy/explain/recalibration.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "search/search_state.h"
#include "smartmill_core/formatted.h"
#include "smartmill_discrepancy/search/screening.h"

namespace smartmill::discrepancy {
namespace {

struct RecalibrationOptions {
  double determined = 2.0;       ///< standard deviations of the fit from which a change is listed
  double share = 0.1;            ///< of the largest change, in stated deviations, from which one is listed
  double stated = 2.0;           ///< stated deviations up to which a change is within the uncertainty
  std::size_t in_sentence = 3;   ///< values that the sentence lists
  std::size_t least_common = 2;  ///< values that have a common factor
  /// [1] of the squared deviations from the stated values: an equivalent effect removes this share of them.
  double share_removed = 0.5;
  /// [1] of that: a smaller predicted share is not fitted, since the prediction is linear.
  double share_predicted = 0.5;
  std::size_t max_fits = 6;  ///< limits the time
};

const RecalibrationOptions LIMITS;

// Factor that all values have in common, weighted by their deviations; 0: none.
double commonFactor(const std::vector<RecalibratedValue>& values) {
  if (values.size() < LIMITS.least_common) return 0.0;
  double weights = 0.0, mean = 0.0;
  const auto weight = [](const RecalibratedValue& v) { return std::pow(v.after / v.std_dev, 2); };
  for (const RecalibratedValue& v : values) {
    mean += weight(v) * std::log(v.after / v.before);
    weights += weight(v);
  }
  mean /= weights;
  const bool common = std::all_of(values.begin(), values.end(), [&](const RecalibratedValue& v) {
    return std::abs(std::log(v.after / v.before) - mean) < LIMITS.determined / std::sqrt(weight(v));
  });
  return common ? std::exp(mean) : 0.0;
}

}  // namespace

std::vector<RecalibratedValue> calibratedValues(const NominalFreedom& freedom, const FitResult& fit) {
  std::vector<RecalibratedValue> values;
  for (std::size_t c = 0; c < fit.state.nominal.size(); ++c) {
    const std::optional<double> stated = freedom.stated(c);
    if (!stated) continue;
    const auto i = static_cast<Eigen::Index>(c);
    const Coordinate& coordinate = freedom.coordinates()[c];
    const double after = *stated * std::exp(fit.state.nominal[c]);
    values.push_back({coordinate.name, *stated, after, after * std::sqrt(fit.covariance(i, i)),
                      fit.state.nominal[c] / coordinate.prior_std});
  }
  std::stable_sort(values.begin(), values.end(), [](const RecalibratedValue& a, const RecalibratedValue& b) {
    return std::abs(a.deviations) > std::abs(b.deviations);
  });
  return values;
}

std::vector<RecalibratedValue> recalibratedValues(const NominalFreedom& freedom, const FitResult& fit) {
  std::vector<RecalibratedValue> values = calibratedValues(freedom, fit);
  if (values.empty()) return values;
  const double least = LIMITS.share * std::abs(values.front().deviations);
  const auto isListed = [least](const RecalibratedValue& v) {
    return std::abs(v.deviations) >= least &&
           std::abs(std::log(v.after / v.before)) >= LIMITS.determined * v.std_dev / v.after;
  };
  values.erase(std::remove_if(values.begin() + 1, values.end(),
                              [&](const RecalibratedValue& v) { return !isListed(v); }),
               values.end());
  return values;
}

// The prediction of an effect in place of moved values is that of a score test at the stated values: its
// gain is what it removes of their squared deviations.
std::vector<Equivalent> equivalentEffects(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                                          const SearchOptions& options, const FitResult& moved) {
  const Fitter& quick = bench.quick();
  FitState stated = moved.state;
  for (std::size_t c = 0; c < stated.nominal.size(); ++c)
    stated.nominal[c] = bench.freedom().coordinates()[c].null;
  const NominalTangents tangents = bench.linearise(stated);
  const FitResult from = quick.fit(stated, &tangents, FitOptions::toEvaluate());
  if (!from.converged) return {};
  const double required = LIMITS.share_removed * moved.penalty;
  const double as_well = moved.chi2 + options.negligible_excess * bench.samples();
  ScreeningMemory memory;
  std::vector<PredictedGain> screened =
      screen(quick, from, tangents, hypotheses, LIMITS.share_predicted * required, &memory);
  // What an effect removes of the squared deviations, not of the residual: many imitate a part of the noise.
  const auto removed = [](const PredictedGain& p) {
    return p.prior_evidence.squares + 2.0 * p.prior_evidence.product;
  };
  std::stable_sort(screened.begin(), screened.end(),
                   [&](const PredictedGain& a, const PredictedGain& b) { return removed(a) > removed(b); });
  std::vector<Equivalent> equivalents;
  std::size_t fits = 0;
  for (const PredictedGain& predicted : screened) {
    if (removed(predicted) < LIMITS.share_predicted * required || fits >= LIMITS.max_fits ||
        bench.cancelled())
      break;
    if (predicted.start.empty()) continue;
    ++fits;
    FitState with = stated;
    with.members.push_back({predicted.hypothesis, predicted.start});
    const FitResult fit = quick.fit(with, &tangents, FitOptions::closely());
    options.log(
        formatted(
            "  in place of the moved values, squares %.4g instead of %.4g, penalty %.4g instead of %.4g  ",
            fit.chi2, moved.chi2, fit.penalty, moved.penalty) +
        predicted.hypothesis->title());
    if (!fit.converged || fit.chi2 > as_well || fit.penalty > moved.penalty - required) continue;
    const Member& member = fit.state.members.back();
    equivalents.push_back(
        {member.hypothesis->effect, describe(member),
         separatingTest(bench.data(), bench.exact().model(moved.state), bench.exact().model(fit.state))});
  }
  return equivalents;
}

std::string sentenceOf(const std::vector<RecalibratedValue>& values,
                       const std::vector<Equivalent>& equivalents) {
  if (values.empty()) return "";
  std::string text = "No effect is missing, but the model's values are off: ";
  for (std::size_t k = 0; k < std::min(values.size(), LIMITS.in_sentence); ++k) {
    const RecalibratedValue& v = values[k];
    text += (k ? ", " : "") + v.name +
            formatted(" %.4g instead of %.4g (%+.1f %%, %.1f stated deviations)", v.after, v.before,
                      100.0 * (v.after / v.before - 1.0), std::abs(v.deviations));
  }
  if (values.size() > LIMITS.in_sentence)
    text += formatted(" and %zu more", values.size() - LIMITS.in_sentence);
  if (const double factor = commonFactor(values); factor > 0.0)
    text += formatted("; all by the common factor %.3f", factor);
  if (std::abs(values.front().deviations) <= LIMITS.stated) text += "; within their stated uncertainty";
  text += ".";
  for (std::size_t k = 0; k < equivalents.size(); ++k)
    text += (k ? " or " : " The same records follow from ") + equivalents[k].text;
  return text + (equivalents.empty() ? "" : " with the values as stated.");
}

}  // namespace smartmill::discrepancy
