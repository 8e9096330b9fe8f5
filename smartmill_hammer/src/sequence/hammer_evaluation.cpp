// What the hits of a HammerSequence say: FRF, modes, and both at the tip.

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "sequence_detail.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_hammer/analysis/hits_needed.h"
#include "smartmill_hammer/analysis/offset_factor.h"
#include "smartmill_hammer/analysis/pole_gains.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill {
namespace hammer {
namespace {

constexpr std::size_t LEAST_HITS = 3, LEAST_JACKKNIFE = 4;
constexpr const char* UNKNOWN = "unknown";
/// The line at zero is the drift of the sensor. [Hz]
constexpr double FIRST_LINE = 1e-3;
/// Fluted length of a tool of which it is not known, in diameters; [m] to which it and the diameter are
/// known.
constexpr Known USUAL_FLUTES{2.0, 0.6};
constexpr double LONGEST_FLUTES = 0.9;  // of the stick-out
/// Of the sensor's nominal gap, where too few readings tell of its curve.
constexpr double UNTOLD_BEND = 0.2;
/// [1/m] wider than where one height is all that there is: the second tells the tilt.
constexpr double TILT_STD = 7.0;
constexpr double FLUTED_STD = 1.0e-3, DIAMETER_STD = 0.02e-3;

/// @param relative [1] deviation of what is common to all lines
void addCommon(FrequencyResponse& frf, double relative) {
  for (std::size_t k = 0; k < frf.size(); ++k)
    frf.std_dev[k] = std::hypot(frf.std_dev[k], relative * std::abs(frf.value[k]));
}

void addCommon(ModalModel& model, double relative) {
  for (Mode& mode : model.modes) mode.gain_std = std::hypot(mode.gain_std, relative * mode.gain);
  model.direct_std = std::hypot(model.direct_std, relative * model.direct);
}

}  // namespace

double HammerSequence::offsetCorrection() const {
  return goal_.stickout > 0.0 && !correctsApart() ? offsetFactor(goal_.stickout, station_.offset) : 1.0;
}

ImpactOptions HammerSequence::impactOptions(const SensorState& sensor) const {
  ImpactOptions options;
  options.exponential_time = parameters_.exponential_time;
  // The blow drives the tool away from the sensor: the voltage falls. Across, the blow's sense is turned too.
  options.response_scale = -sensor.sensitivity * offsetCorrection();
  if (parameters_.straighten_sensor == 0) return options;
  options.sensor_gain = std::isfinite(sensor.bend_gap) ? sensor.bend_gap / sensor.sensitivity - sensor.volt
                                                       : station_.gain_volt;
  options.averaged_share = parameters_.averaged_share;
  return options;
}

FrequencyResponse HammerSequence::averaged(const std::vector<Hit>& hits, const SensorState& sensor) const {
  ImpactAnalysis analysis(impactOptions(sensor));
  for (const Hit& hit : hits) analysis.add(hit);
  return analysis.frf().band(FIRST_LINE, parameters_.frf_high);
}

// Three at least: of fewer none can be told to be odd.
bool HammerSequence::enough() const {
  const std::vector<Hit>& hits = second_ ? second_hits_ : hits_;
  if (!(parameters_.asked_std > 0.0) || hits.size() < LEAST_HITS) return false;
  return hitsNeeded(averaged(hits, second_ ? second_sensor_ : sensor_), parameters_.fit_low,
                    parameters_.fit_high, parameters_.asked_std)
      .enough();
}

/// How the modes scatter from tap to tap: the fit's lines are not independent of one another (a blow's
/// spectrum above half the sample rate, for one, turns all of them alike), so each blow is left out in turn
/// (the jackknife); few blows make a wide answer, by Student's t. The larger of both deviations counts.
void HammerSequence::addScatter(const FrequencyResponse& frf, ModalModel& model) const {
  const auto n = static_cast<double>(hits_.size());
  if (hits_.size() < LEAST_JACKKNIFE) return;
  std::vector<ModalModel> shifts;
  for (std::size_t h = 0; h < hits_.size(); ++h) {
    std::vector<Hit> others = hits_;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(h));
    std::vector<std::complex<double>> change = averaged(others, sensor_).value;
    for (std::size_t k = 0; k < frf.size(); ++k) change[k] -= frf.value[k];
    shifts.push_back(shiftOf(frf, change, model, parameters_.fit_low, parameters_.fit_high));
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

/// What repeats from blow to blow, and so no scatter shows: how well the sensor's curve is known by which the
/// vibration is bent straight, and modes across the direction, of which the station's axes show a share. The
/// curve's part is added to the lines too.
void HammerSequence::addSystematic(FrequencyResponse& frf, ModalModel& model) const {
  const double across = std::pow(parameters_.axes_turn_std, 2);
  for (Mode& mode : model.modes) {
    // Somewhere within its width a mode across bends the other: its phase by its share, its damping too.
    mode.frequency_std = std::hypot(mode.frequency_std, 0.5 * across * mode.damping_ratio * mode.frequency);
    mode.damping_ratio_std = std::hypot(mode.damping_ratio_std, across * mode.damping_ratio);
    mode.gain_std = std::hypot(mode.gain_std, across * mode.gain);
  }
  if (parameters_.straighten_sensor == 0) return;
  SensorState other = sensor_;
  const bool told = std::isfinite(sensor_.bend_gap);
  if (!told) other.bend_gap = (station_.gain_volt + sensor_.volt) * sensor_.sensitivity;
  other.bend_gap += told ? sensor_.bend_gap_std : UNTOLD_BEND * other.bend_gap;
  const FrequencyResponse bent = averaged(hits_, other);
  std::vector<std::complex<double>> change(frf.size());
  for (std::size_t k = 0; k < frf.size(); ++k) change[k] = bent.value[k] - frf.value[k];
  const ModalModel shift = shiftOf(frf, change, model, parameters_.fit_low, parameters_.fit_high);
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

ToolBeam HammerSequence::toolBeam() const {
  ToolBeam tool;
  tool.stickout = {goal_.stickout, parameters_.stickout_std};
  tool.diameter = {tool_.diameter, DIAMETER_STD};
  const double longest = LONGEST_FLUTES * goal_.stickout;
  tool.fluted_length =
      parameters_.tool_fluted_length > 0.0
          ? Known{std::min(parameters_.tool_fluted_length, longest), FLUTED_STD}
          : Known{std::min(USUAL_FLUTES.value * tool_.diameter, longest), USUAL_FLUTES.std * tool_.diameter};
  if (parameters_.tool_material != UNKNOWN) setMaterial(tool, parameters_.tool_material);
  return tool;
}

/// What was found where; at the second height with the first one's poles.
std::vector<OffsetMeasurement> HammerSequence::atHeights(const ModalModel& modes) const {
  const double read = parameters_.read_height, struck = read + station_.offset;
  const auto relative = [](const SensorState& s) { return s.sensitivity_std / s.sensitivity; };
  std::vector<OffsetMeasurement> all = {{struck, read, modes, relative(sensor_)}};
  if (second_hits_.empty()) return all;
  const ModalModel above =
      gainsAtPoles(averaged(second_hits_, second_sensor_), modes, parameters_.fit_low, parameters_.fit_high);
  all.push_back({struck + lowered(), read + lowered(), above, relative(second_sensor_)});
  return all;
}

TipCorrection HammerSequence::tipOf(const ModalModel& modes) const {
  HolderPrior prior;
  prior.height = parameters_.height_std;
  prior.tilt.std = TILT_STD;
  const TipCorrection tip = correctToTip(atHeights(modes), toolBeam(), prior, parameters_.fit_high);
  return parameters_.tool_material == UNKNOWN ? withoutBeyond(tip) : tip;
}

/// Struck along the goal's direction, read across it. What a mode gains from the struck height to the tip it
/// gains across too.
void HammerSequence::evaluateCross(const std::optional<TipCorrection>& tip) {
  if (cross_hits_.size() != hits_.size() || !std::isfinite(cross_sensor_.sensitivity)) return;
  MeasuredFrf& cross = result_.cross;
  cross.stamp = result_.frf.stamp;
  cross.tool = goal_.tool;
  cross.point = goal_.point;
  cross.direction = goal_.direction + AXIS_NAMES[1 - direction_];
  cross.frf = averaged(cross_hits_, cross_sensor_);
  if (tip) cross.frf = crossTipResponse(cross.frf, *tip, parameters_.fit_low, parameters_.fit_high);
  addCommon(cross.frf, cross_sensor_.sensitivity_std / cross_sensor_.sensitivity);
}

/// FRF and modes as measured become those of the tip. Where no beam explains the modes, the truth lies
/// between no correction and eq. 4.44, and nothing more is known.
void HammerSequence::toTip(const FrequencyResponse& frf, const ModalFit& fit) {
  std::optional<TipCorrection> tip;
  try {
    tip = tipOf(fit.model);
    result_.frf.frf = tipResponse(frf, *tip);
    result_.modes.model = tip->model();
    result_.message +=
        second_hits_.empty() ? ", tip by the tool's beam" : ", tip by two heights and the beam";
    if (!no_second_.empty()) result_.message += ", no second height: " + no_second_;
  } catch (const Error& error) {
    const double thesis = offsetFactor(goal_.stickout, station_.offset);
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
    result_.message += ", tip not told (" + std::string(error.what()) + "): half of eq. 4.44";
  }
  evaluateCross(tip);
}

void HammerSequence::evaluate() {
  const ImpactOptions options = impactOptions(sensor_);
  const double relative = result_.sensitivity_std / result_.sensitivity;
  result_.frf.stamp = result_.modes.stamp = hits_.back().stamp;
  result_.frf.tool = result_.modes.tool = goal_.tool;
  result_.frf.point = result_.modes.point = goal_.point;
  result_.frf.direction = result_.modes.direction = goal_.direction;
  result_.modes.unit = options.unit;
  try {
    FrequencyResponse frf = averaged(hits_, sensor_);
    ModalFitOptions fit_options;
    fit_options.low = parameters_.fit_low;
    fit_options.high = parameters_.fit_high;
    fit_options.modes = goal_.modes;
    fit_options.max_modes = parameters_.max_modes;
    // Of one factor for all modes hit and response are at the tip after it.
    fit_options.positive_gains = !correctsApart();
    // The sensitivity's error is common to all lines: it takes no part in the fit and is added after it.
    result_.frf.frf = frf;
    ModalFit fit = fitModes(frf, fit_options);
    addScatter(frf, fit.model);
    addSystematic(frf, fit.model);
    result_.modes.model = result_.measured = fit.model;
    result_.frf.frf = result_.measured_frf = frf;
    addCommon(result_.measured, relative);
    result_.modes.relative_error = fit.relative_error;
    result_.message = std::to_string(hits_.size() + second_hits_.size()) + " hits, " +
                      std::to_string(fit.model.modes.size()) + " modes";
    if (correctsApart()) {
      toTip(frf, fit);
    } else {
      evaluateCross(std::nullopt);
      if (goal_.stickout > 0.0) result_.message += formatted(", offset correction %.3f", offsetCorrection());
    }
    if (!no_cross_.empty()) result_.message += ", no cross FRF: " + no_cross_;
    addCommon(result_.modes.model, relative);
    ImpactAnalysis(options).removeWindowDamping(result_.modes.model);
  } catch (const Error& error) {
    result_.code = FrfCode::fit_failed;
    result_.message = error.what();
  }
  addCommon(result_.frf.frf, relative);
}

}  // namespace hammer
}  // namespace smartmill
