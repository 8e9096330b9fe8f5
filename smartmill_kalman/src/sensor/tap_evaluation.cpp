#include "tap_evaluation.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill::kalman {
namespace {

/// Least number of lines for the static gain.
constexpr std::size_t MIN_STATIC_LINES = 4;
/// Share of the pre-trigger time before the rise of the hit.
constexpr double QUIET_SHARE = 0.75;

/// Mean of the real part over the lines below the fit's band, where the sensor has no dynamics yet.
void estimateStaticGain(const FrequencyResponse& frf, const TapParameters& parameters, SensorResult& result) {
  double weights = 0.0, sum = 0.0;
  for (std::size_t k = 0; k < frf.size() && (k < MIN_STATIC_LINES || frf.frequency[k] <= parameters.fit_low);
       ++k) {
    const double weight = std::isfinite(frf.std_dev[k]) ? 2.0 / std::norm(frf.std_dev[k]) : 0.0;
    weights += weight;
    sum += weight * frf.value[k].real();
  }
  result.static_gain = sum / weights;
  result.static_gain_std = 1.0 / std::sqrt(weights);
}

}  // namespace

SensorResult evaluateTaps(const std::vector<Hit>& hits, const MeasureFrfGoal& goal,
                          const TapParameters& parameters) {
  SensorResult result;
  result.frf.stamp = result.modes.stamp = hits.back().stamp;
  result.frf.tool = result.modes.tool = goal.tool;
  result.frf.point = result.modes.point = goal.point;
  result.frf.direction = result.modes.direction = goal.direction;
  result.modes.unit = "1";
  for (const Hit& hit : hits) result.hit_stamps.push_back(hit.stamp);
  try {
    for (const Hit& hit : hits) {
      const auto quiet = static_cast<std::ptrdiff_t>(QUIET_SHARE * static_cast<double>(hit.pre_trigger));
      result.noise_rms +=
          std::pow(standardDeviation({hit.response.begin(), hit.response.begin() + quiet}), 2) /
          static_cast<double>(hits.size());
    }
    result.noise_rms = std::sqrt(result.noise_rms);
    ImpactOptions options;
    options.unit = "1";
    ImpactAnalysis analysis(options);
    for (const Hit& hit : hits) analysis.add(hit);
    // The line at 0 Hz is the drift of the sensor.
    FrequencyResponse frf = analysis.frf().band(1e-3, parameters.frf_high);
    estimateStaticGain(frf, parameters, result);
    const double off = std::abs(std::abs(result.static_gain) - 1.0);
    if (!(off <= parameters.static_tolerance + 4.0 * result.static_gain_std)) {
      result.code = FrfCode::bad_data;
      result.message =
          formatted("static gain %.3f +- %.3f, expected 1: check the sensitivities of hammer and sensor",
                    result.static_gain, result.static_gain_std);
      return result;
    }
    for (std::size_t k = 0; k < frf.size(); ++k) {
      if (result.static_gain < 0.0) frf.value[k] = -frf.value[k];
      frf.std_dev[k] = std::hypot(frf.std_dev[k], parameters.systematic * std::abs(frf.value[k]));
    }
    result.frf.frf = frf;
    ModalFitOptions fit_options;
    fit_options.low = parameters.fit_low;
    fit_options.high = std::min(parameters.fit_high, frf.frequency.back());
    fit_options.modes = goal.modes;
    fit_options.max_modes = parameters.max_modes;
    fit_options.unit_static_gain = true;
    const ModalFit fit = fitModes(frf, fit_options);
    result.modes.model = fit.model;
    result.modes.relative_error = fit.relative_error;
    result.message = std::to_string(hits.size()) + " hits, " + std::to_string(fit.model.modes.size()) +
                     " modes, static gain measured " +
                     formatted("%.3f +- %.3f", result.static_gain, result.static_gain_std);
  } catch (const Error& error) {
    result.code = FrfCode::fit_failed;
    result.message = error.what();
  }
  return result;
}

}  // namespace smartmill::kalman
