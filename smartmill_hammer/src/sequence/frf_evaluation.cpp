#include "frf_evaluation.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_hammer/analysis/hits_needed.h"
#include "smartmill_hammer/analysis/offset_factor.h"
#include "smartmill_hammer/analysis/pole_gains.h"

namespace smartmill::hammer {
namespace {

constexpr const char* UNKNOWN = "unknown";
constexpr double FIRST_LINE = 1e-3;  // [Hz] the line at zero is the drift of the sensor

/// @param relative [1] standard deviation that all lines have in common
void addCommonError(FrequencyResponse& frf, double relative) {
  for (std::size_t k = 0; k < frf.size(); ++k)
    frf.std_dev[k] = std::hypot(frf.std_dev[k], relative * std::abs(frf.value[k]));
}

void addCommonError(ModalModel& model, double relative) {
  for (Mode& mode : model.modes) mode.gain_std = std::hypot(mode.gain_std, relative * mode.gain);
  model.direct_std = std::hypot(model.direct_std, relative * model.direct);
}

double relativeStd(const SensorState& sensor) {
  return sensor.sensitivity_std / sensor.sensitivity;
}

}  // namespace

FrfEvaluation::FrfEvaluation(Measurement& measurement)
    : measurement_(measurement),
      parameters_(measurement.parameters),
      goal_(measurement.goal),
      result_(measurement.result) {
}

double FrfEvaluation::offsetCorrection() const {
  return goal_.stickout > 0.0 && !measurement_.correctsPerMode()
             ? offsetFactor(goal_.stickout, measurement_.station.offset)
             : 1.0;
}

ImpactOptions FrfEvaluation::impactOptions(const SensorState& sensor) const {
  ImpactOptions options;
  options.exponential_time = parameters_.exponential_time;
  // A hit away from the sensor lowers the voltage. For the cross FRF this turns the sense of the hit.
  options.response_scale = measurement_.hitSense() * sensor.sensitivity * offsetCorrection();
  if (parameters_.straighten_sensor == 0) return options;
  options.sensor_gain = std::isfinite(sensor.curve_gap) ? sensor.curve_gap / sensor.sensitivity - sensor.volt
                                                        : measurement_.station.gain_volt;
  options.averaged_share = parameters_.averaged_share;
  return options;
}

FrequencyResponse FrfEvaluation::averageOf(const std::vector<Hit>& hits, const SensorState& sensor) const {
  ImpactAnalysis analysis(impactOptions(sensor));
  for (const Hit& hit : hits) analysis.add(hit);
  return analysis.frf().band(FIRST_LINE, parameters_.frf_high);
}

bool FrfEvaluation::isPreciseEnough() const {
  const HeightHits& height = measurement_.height();
  if (!(parameters_.asked_std > 0.0) || height.hits.size() < parameters_.least_hits) return false;
  return hitsNeeded(averageOf(height.hits, height.sensor), parameters_.fit_low, parameters_.fit_high,
                    parameters_.asked_std)
      .isReached();
}

/// Scatter of the modes from hit to hit. The lines of the fit are not independent of one another (a hit's
/// spectrum above half the sample rate turns many alike), so each hit is left out in turn (the jackknife),
/// widened by Student's t for few hits. The larger of both deviations counts.
void FrfEvaluation::addScatter(const FrequencyResponse& frf, ModalModel& model) const {
  const HeightHits& first = measurement_.first;
  const auto n = static_cast<double>(first.hits.size());
  if (first.hits.size() < parameters_.least_jackknife) return;
  std::vector<ModalModel> shifts;
  for (std::size_t h = 0; h < first.hits.size(); ++h) {
    std::vector<Hit> others = first.hits;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(h));
    std::vector<std::complex<double>> change = averageOf(others, first.sensor).value;
    for (std::size_t k = 0; k < frf.size(); ++k) change[k] -= frf.value[k];
    shifts.push_back(modeShifts(frf, change, model, parameters_.fit_low, parameters_.fit_high));
  }
  const double wide = std::sqrt((n - 1.0) / n) * studentOverNormal(n - 1.0);
  for (std::size_t k = 0; k < model.modes.size(); ++k) {
    const auto scatter = [&](double Mode::*value) {
      double sum = 0.0, squares = 0.0;
      for (const ModalModel& s : shifts) sum += s.modes[k].*value;
      for (const ModalModel& s : shifts) squares += std::pow(s.modes[k].*value - sum / n, 2);
      return wide * std::sqrt(squares);
    };
    Mode& mode = model.modes[k];
    mode.frequency_std = std::max(mode.frequency_std, scatter(&Mode::frequency));
    mode.damping_ratio_std = std::max(mode.damping_ratio_std, scatter(&Mode::damping_ratio));
    mode.gain_std = std::max(mode.gain_std, scatter(&Mode::gain));
  }
}

/// Modes across the direction appear by the square of the angle between the station's and the structure's
/// axes. Within the width of a mode one of them changes its phase and damping by that share at most.
void FrfEvaluation::addCrossAxisError(ModalModel& model) const {
  const double across = std::pow(parameters_.axes_turn_std, 2);
  for (Mode& mode : model.modes) {
    mode.frequency_std = std::hypot(mode.frequency_std, 0.5 * across * mode.damping_ratio * mode.frequency);
    mode.damping_ratio_std = std::hypot(mode.damping_ratio_std, across * mode.damping_ratio);
    mode.gain_std = std::hypot(mode.gain_std, across * mode.gain);
  }
}

/// The uncertainty of the sensor's curve, by which the vibration is linearised, repeats from hit to hit, so
/// that no scatter contains it.
void FrfEvaluation::addCurveError(FrequencyResponse& frf, ModalModel& model) const {
  if (parameters_.straighten_sensor == 0) return;
  const HeightHits& first = measurement_.first;
  SensorState other = first.sensor;
  const bool calibrated = std::isfinite(other.curve_gap);
  if (!calibrated) other.curve_gap = (measurement_.station.gain_volt + other.volt) * other.sensitivity;
  other.curve_gap += calibrated ? other.curve_gap_std : parameters_.nominal_gap_std * other.curve_gap;
  std::vector<std::complex<double>> change = averageOf(first.hits, other).value;
  for (std::size_t k = 0; k < frf.size(); ++k) change[k] -= frf.value[k];
  const ModalModel shift = modeShifts(frf, change, model, parameters_.fit_low, parameters_.fit_high);
  for (std::size_t k = 0; k < model.modes.size(); ++k) {
    Mode& mode = model.modes[k];
    const Mode& by = shift.modes[k];
    mode.frequency_std = std::hypot(mode.frequency_std, by.frequency);
    mode.damping_ratio_std = std::hypot(mode.damping_ratio_std, by.damping_ratio);
    mode.gain_std = std::hypot(mode.gain_std, by.gain);
  }
  for (std::size_t k = 0; k < frf.size(); ++k)
    frf.std_dev[k] = std::hypot(frf.std_dev[k], std::abs(change[k]));
}

ToolBeam FrfEvaluation::toolBeam() const {
  const double diameter = measurement_.tool.diameter, longest = parameters_.longest_flutes * goal_.stickout;
  ToolBeam tool;
  tool.stickout = {goal_.stickout, parameters_.stickout_std};
  tool.diameter = {diameter, parameters_.diameter_std};
  tool.fluted_length =
      parameters_.tool_fluted_length > 0.0
          ? UncertainValue{std::min(parameters_.tool_fluted_length, longest), parameters_.fluted_std}
          : UncertainValue{std::min(parameters_.usual_flutes * diameter, longest),
                           parameters_.usual_flutes_std * diameter};
  if (parameters_.tool_material != UNKNOWN) setMaterial(tool, parameters_.tool_material);
  return tool;
}

/// The modes of the first height, and their gains at the second.
std::vector<OffsetMeasurement> FrfEvaluation::offsetMeasurements(const ModalModel& modes) const {
  const double read = parameters_.read_height, struck = read + measurement_.station.offset;
  std::vector<OffsetMeasurement> all = {{struck, read, modes, relativeStd(measurement_.first.sensor)}};
  const HeightHits& second = measurement_.second;
  if (second.hits.empty()) return all;
  const ModalModel above =
      gainsAtPoles(averageOf(second.hits, second.sensor), modes, parameters_.fit_low, parameters_.fit_high);
  const double lowered = measurement_.lowered();
  all.push_back({struck + lowered, read + lowered, above, relativeStd(second.sensor)});
  return all;
}

TipCorrection FrfEvaluation::tipCorrection(const ModalModel& modes) const {
  HolderPrior prior;
  prior.height = parameters_.height_std;
  prior.tilt.std = parameters_.tilt_std;
  const TipCorrection tip =
      hammer::correctToTip(offsetMeasurements(modes), toolBeam(), prior, parameters_.fit_high);
  return parameters_.tool_material == UNKNOWN ? withoutBeyond(tip) : tip;
}

/// Struck along the goal's direction, measured across it. A mode's factor from the struck height to the tip
/// is the same across.
void FrfEvaluation::evaluateCross(const std::optional<TipCorrection>& tip) {
  const HeightHits& measured = measurement_.cross;
  if (measured.hits.size() != measurement_.first.hits.size() || !std::isfinite(measured.sensor.sensitivity))
    return;
  MeasuredFrf& cross = result_.cross;
  cross.stamp = result_.frf.stamp;
  cross.tool = goal_.tool;
  cross.point = goal_.point;
  cross.direction = goal_.direction + AXIS_NAMES[measurement_.paths.across()];
  cross.frf = averageOf(measured.hits, measured.sensor);
  if (tip) cross.frf = crossTipResponse(cross.frf, *tip, parameters_.fit_low, parameters_.fit_high);
  addCommonError(cross.frf, relativeStd(measured.sensor));
}

/// Where no beam explains the modes, the receptance at the tip lies between the measured one and that of eq.
/// 4.44: their mean, with the standard deviation of a uniform distribution.
void FrfEvaluation::useHalfCorrection(const FrequencyResponse& frf) {
  const double thesis = offsetFactor(goal_.stickout, measurement_.station.offset);
  const double factor = 0.5 * (1.0 + thesis), spread = (thesis - 1.0) / std::sqrt(12.0);
  for (std::size_t k = 0; k < frf.size(); ++k) {
    result_.frf.frf.value[k] = factor * frf.value[k];
    result_.frf.frf.std_dev[k] = std::hypot(factor * frf.std_dev[k], spread * std::abs(frf.value[k]));
  }
  for (Mode& mode : result_.modes.model.modes) {
    mode.gain_std = std::hypot(factor * mode.gain_std, spread * mode.gain);
    mode.gain *= factor;
  }
  result_.modes.model.direct *= factor;
}

void FrfEvaluation::correctToTip(const FrequencyResponse& frf, const ModalModel& modes) {
  std::optional<TipCorrection> tip;
  try {
    tip = tipCorrection(modes);
    result_.frf.frf = tipResponse(frf, *tip);
    result_.modes.model = tip->model();
    result_.message += measurement_.second.hits.empty() ? ", tip from the tool's beam"
                                                        : ", tip from two heights and the beam";
    if (!measurement_.no_second_height.empty())
      result_.message += ", no second height: " + measurement_.no_second_height;
  } catch (const Error& error) {
    useHalfCorrection(frf);
    result_.message += ", tip undetermined (" + std::string(error.what()) + "): half of eq. 4.44";
  }
  evaluateCross(tip);
}

void FrfEvaluation::fit() {
  const HeightHits& first = measurement_.first;
  FrequencyResponse frf = averageOf(first.hits, first.sensor);
  ModalFitOptions options;
  options.low = parameters_.fit_low;
  options.high = parameters_.fit_high;
  options.modes = goal_.modes;
  options.max_modes = parameters_.max_modes;
  // With one factor for all modes, hit and response are both at the tip after it.
  options.positive_gains = !measurement_.correctsPerMode();
  // The sensitivity's error is common to all lines: it takes no part in the fit and is added afterwards.
  result_.frf.frf = frf;
  ModalFit fit = fitModes(frf, options);
  addScatter(frf, fit.model);
  addCrossAxisError(fit.model);
  addCurveError(frf, fit.model);
  result_.modes.model = result_.measured = fit.model;
  result_.frf.frf = result_.measured_frf = frf;
  addCommonError(result_.measured, relativeStd(first.sensor));
  result_.modes.relative_error = fit.relative_error;
  result_.message = std::to_string(first.hits.size() + measurement_.second.hits.size()) + " hits, " +
                    std::to_string(fit.model.modes.size()) + " modes";
  if (measurement_.correctsPerMode()) {
    correctToTip(frf, fit.model);
  } else {
    evaluateCross(std::nullopt);
    if (goal_.stickout > 0.0) result_.message += formatted(", offset correction %.3f", offsetCorrection());
  }
  if (!measurement_.no_cross.empty()) result_.message += ", no cross FRF: " + measurement_.no_cross;
  addCommonError(result_.modes.model, relativeStd(first.sensor));
  ImpactAnalysis(impactOptions(first.sensor)).removeWindowDamping(result_.modes.model);
}

void FrfEvaluation::evaluate() {
  const HeightHits& first = measurement_.first;
  result_.frf.stamp = result_.modes.stamp = first.hits.back().stamp;
  result_.frf.tool = result_.modes.tool = goal_.tool;
  result_.frf.point = result_.modes.point = goal_.point;
  result_.frf.direction = result_.modes.direction = goal_.direction;
  result_.modes.unit = impactOptions(first.sensor).unit;
  try {
    fit();
  } catch (const Error& error) {
    result_.code = FrfCode::fit_failed;
    result_.message = error.what();
  }
  addCommonError(result_.frf.frf, relativeStd(first.sensor));
}

}  // namespace smartmill::hammer
