// A HammerSequence on its way to the hits: to the station, flutes found, sensors calibrated.

#include <algorithm>
#include <cmath>
#include <utility>

#include "sequence_detail.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill {
namespace hammer {
namespace {

/// Of the first search's step: the helix tells the second where to begin.
constexpr double SECOND_STEP = 0.5;
/// Of the trial blow's swing: no later one's is larger.
constexpr double LARGEST_SWING = 1.5;
/// [1] of the gap at zero volt by which a flank seen from the same place may be nearer.
constexpr double SAME_FLANK = 0.1;

}  // namespace

FluteSearchOptions HammerSequence::searchOptions() const {
  FluteSearchOptions options = FluteSearchOptions::forPitch(pitch_);
  const double scale = options.first_step / FluteSearchOptions().first_step;
  options.first_step = scale * parameters_.bracket_first_step;
  options.max_step = std::max(options.first_step, std::min(parameters_.bracket_max_step, 0.25 * pitch_));
  options.tolerance = scale * parameters_.flute_tolerance;
  options.range_volt = station_.range_volt;
  options.noise_sigmas = parameters_.noise_sigmas;
  options.least_rise = parameters_.least_rise;
  options.golden_only = parameters_.golden_only != 0;
  if (stage_ == Stage::search_high && !options.golden_only) options.first_step *= SECOND_STEP;
  return options;
}

void HammerSequence::moveToStation(double now) {
  const Axes3 station = stationPosition();
  Axes3 here{};
  double to_go = 0.0;
  readPosition(*state_, here, to_go);
  Axes3 above = station;
  above[static_cast<std::size_t>(direction_)] -= parameters_.standoff;
  above[2] = std::max(safeHeight(), here[2]);
  Axes3 up = here, beside = above;
  up[2] = above[2];
  beside[2] = station[2];
  Axes3 near = station;
  near[static_cast<std::size_t>(direction_)] -= parameters_.near_path;
  at_station_ = true;
  move(now, here,
       {{up, 0.0},
        {above, 0.0},
        {beside, parameters_.approach_feed},
        {near, parameters_.approach_feed},
        {station, parameters_.jog_feed}});
}

void HammerSequence::reached(double now) {
  wait_ = Wait::nothing;
  switch (stage_) {
    case Stage::orient_start:
      stage_ = Stage::to_station;
      say("moving to the hammer station " + goal_.direction, 0.05);
      return moveToStation(now);
    case Stage::to_station:
      stage_ = Stage::search_low;
      say("searching a flute at the tip", 0.1);
      search_.emplace(parameters_.start_angle, searchOptions());
      return orient(now, search_->next());
    case Stage::search_low:
    case Stage::search_high:
    case Stage::survey:
    case Stage::calibrate:
    case Stage::calibrate_cross:
    case Stage::calibrate_again:
    case Stage::calibrate_second:
      return average(now + parameters_.settle_time);
    case Stage::to_second:
      stage_ = Stage::orient_second;
      say("turning the flute to the hammer at the second height", 0.84);
      // As far beyond the hammer's first height as that is above the tip's search, at the same helix.
      return orient(now, result_.flute_low + (result_.flute_hammer - result_.flute_low) *
                                                 (1.0 + lowered() / station_.offset));
    case Stage::orient_second:
      stage_ = Stage::calibrate_second;
      say("calibrating the displacement sensor at the second height", 0.85);
      return average(now + parameters_.settle_time);
    case Stage::to_height:
      stage_ = Stage::search_high;
      say("searching the flute halfway up to the hammer", 0.3);
      // A right-hand helix lags with height: the spindle must turn on by the lag.
      expected_angle_ = result_.flute_low + tool_.lag() * 0.5 * station_.offset;
      search_.emplace(expected_angle_, searchOptions());
      return orient(now, search_->next());
    case Stage::to_tip:
      stage_ = Stage::orient_flute;
      say("turning the flute to the hammer", 0.5);
      return orient(now, result_.flute_hammer);
    case Stage::orient_flute:
      stage_ = Stage::calibrate;
      say("calibrating the displacement sensor", surveyed_ ? 0.58 : 0.55);
      return average(now + parameters_.settle_time);
    case Stage::retract:
      return finish();
    default:
      return;
  }
}

/// The axis along which the sensor now calibrated looks.
std::size_t HammerSequence::calibratedAxis() const {
  const auto along = static_cast<std::size_t>(direction_);
  return stage_ == Stage::calibrate_cross ? 1 - along : along;
}

/// [rad] that the spindle, a flute at the hammer, stands from a flute at the sensor of an axis.
double HammerSequence::turnedFrom(std::size_t axis) const {
  const double across = axis == static_cast<std::size_t>(direction_) ? 0.0
                        : axis == 0                                  ? 0.5 * units::PI
                                                                     : -0.5 * units::PI;
  return result_.flute_hammer - result_.flute_low - across;
}

/// [m] towards the sensor until the tool would be as near to its face as allowed. The helix lags as the model
/// says and as the flutes found halfway up tell: by all between.
double HammerSequence::safeTravel(std::size_t axis) const {
  const double found = (result_.flute_hammer - result_.flute_low) / station_.offset, told = tool_.lag();
  const SensorApproach::Place place{turnedFrom(axis), parameters_.read_height + (second_ ? lowered() : 0.0),
                                    std::min(found, told), std::max(found, told)};
  return approach_.travel(place) - movedFrom(axis) - swing_.value_or(0.0);
}

/// [m] nearer to the sensor than the station.
double HammerSequence::movedFrom(std::size_t axis) const {
  return target_[axis] - stationPosition()[axis];
}

SensorCalibrationOptions HammerSequence::calibrationOptions(std::size_t axis) const {
  SensorCalibrationOptions o;
  o.first_jog = parameters_.first_jog;
  o.max_jog = parameters_.max_jog;
  o.least_jog = parameters_.least_jog;
  o.resolution = parameters_.resolution;
  o.zero_volt = parameters_.zero_volt;
  o.check_jog = parameters_.check_jog;
  o.curve_jog = parameters_.curve_jog;
  o.position_std = parameters_.position_std;
  o.range_volt = station_.range_volt;
  o.gain_volt = station_.gain_volt;
  o.gap_at_zero_volt = station_.gap_at_zero_volt;
  o.min_gap = parameters_.min_gap_share * station_.gap_at_zero_volt;
  o.swing = swing_.value_or(0.0);
  // The flute faces the hammer, so the sensor may look between two flutes.
  o.max_travel = parameters_.max_approach + station_.flute_depth;
  o.safe_travel = safeTravel(axis);
  return o;
}

void HammerSequence::measured(double now, double volt, double volt_std) {
  if (stage_ == Stage::calibrate || stage_ == Stage::calibrate_cross || stage_ == Stage::calibrate_again ||
      stage_ == Stage::calibrate_second) {
    return calibrated(now, volt, volt_std);
  }
  if (stage_ == Stage::survey) return surveyed(now, volt);
  search_->give(reached_angle_, volt, volt_std);
  if (search_->state() == FluteSearch::State::searching) return orient(now, search_->next());
  if (search_->state() == FluteSearch::State::no_flute) {
    return abort(now, FrfCode::no_flute, search_->reason());
  }
  if (search_->volt() > RANGE_SHARE * station_.range_volt) {
    return abort(
        now, FrfCode::no_flute,
        formatted("the flute is too near to the sensor: %.2f V is the end of its range", search_->volt()));
  }
  fluteFound(now);
}

/// Whether what is known of the flanks would hold the tool back before the sensor is zeroed: then two more
/// readings to either side, from the station's safe distance.
bool HammerSequence::surveyDue(double volt) {
  if (std::exchange(surveyed_, true)) return false;
  const auto along = static_cast<std::size_t>(direction_);
  const double due = approach_.nominalGap(volt) - station_.gap_at_zero_volt + parameters_.check_jog;
  if (safeTravel(along) >= due) return false;
  const double beside = 0.5 * std::asin(std::min(0.9, 0.5 * parameters_.sensor_face / tool_.radius()));
  survey_ = {beside, -beside};
  return true;
}

/// How far a blow lets the tool swing towards the sensor, by the sensor's nominal curve, which far from it
/// and before a flank tells rather too much.
void HammerSequence::tried(double now, const Hit& hit) {
  const auto before =
      hit.response.begin() + static_cast<std::ptrdiff_t>(std::max<std::size_t>(1, hit.pre_trigger / 2));
  const double rest = mean({hit.response.begin(), before});
  const double top = *std::max_element(hit.response.begin(), hit.response.end());
  const double noise = 3.0 * standardDeviation({hit.response.begin(), before});
  swing_ = LARGEST_SWING *
           std::max(0.0, approach_.nominalGap(rest) - approach_.nominalGap(std::max(rest, top - noise)));
  swing_ = std::min(*swing_, station_.gap_at_zero_volt);
  stage_ = Stage::calibrate;
  say(formatted("a blow swings the tool by %.0f um at most towards the sensor", 1e6 * *swing_), 0.6);
  average(now + parameters_.rest_time);
}

void HammerSequence::surveyed(double now, double volt) {
  const auto along = static_cast<std::size_t>(direction_);
  approach_.seen(turnedFrom(along) + survey_.back(), volt, movedFrom(along));
  survey_.pop_back();
  if (!survey_.empty()) return orient(now, result_.flute_hammer + survey_.back());
  stage_ = Stage::orient_flute;
  orient(now, result_.flute_hammer);
}

void HammerSequence::calibrated(double now, double volt, double volt_std) {
  if (!calibration_) {
    if (stage_ == Stage::calibrate) flank_volt_ = volt;
    // Seen from the same place, nearer than at the tip: the flutes end here, or run otherwise. Then nothing
    // is known of the flanks, and the tool counts as round.
    if (stage_ == Stage::calibrate_second &&
        approach_.nominalGap(volt) <
            approach_.nominalGap(flank_volt_) - SAME_FLANK * station_.gap_at_zero_volt)
      approach_.forget();
    if (stage_ != Stage::calibrate_again) {
      const std::size_t axis = calibratedAxis();
      approach_.seen(turnedFrom(axis), volt, movedFrom(axis), stage_ != Stage::calibrate_cross);
    }
    if (stage_ == Stage::calibrate && surveyDue(volt)) {
      stage_ = Stage::survey;
      say("looking at the flanks that the sensor's face will meet", 0.56);
      return orient(now, result_.flute_hammer + survey_.back());
    }
    if (stage_ == Stage::calibrate && !swing_) {
      stage_ = Stage::trial;
      say("a trial blow, before the tool nears the sensor", 0.59);
      return strike(now);
    }
    calibration_.emplace(calibrationOptions(calibratedAxis()));
    calibration_->start(volt, volt_std);
  } else {
    calibration_->give(volt, volt_std);
    const std::optional<SensorCurve> curve = calibration_->curve();
    if (curve && stage_ != Stage::calibrate_cross) {
      const auto along = static_cast<std::size_t>(direction_);
      approach_.curveSeen(*curve);
      if (stage_ != Stage::calibrate_again) approach_.seen(turnedFrom(along), volt, movedFrom(along));
      calibration_->allow(calibration_->travelled() + safeTravel(calibratedAxis()));
    }
  }
  switch (calibration_->state()) {
    case SensorCalibration::State::jogging:
      return jog(now, AXIS_NAMES[calibratedAxis()], calibration_->next(), parameters_.jog_feed);
    case SensorCalibration::State::failed:
      if (stage_ == Stage::calibrate_cross) return crossFailed(now);
      if (stage_ == Stage::calibrate_second)
        return withoutSecond(now, "sensor calibration: " + calibration_->reason());
      return abort(now, FrfCode::bad_data, "sensor calibration: " + calibration_->reason());
    case SensorCalibration::State::done:
      return sensorKnown(now);
  }
}

/// With a second sensor the first is done again: the second's jogs have moved the round tool before it.
void HammerSequence::sensorKnown(double now) {
  SensorState& sensor = stage_ == Stage::calibrate_cross    ? cross_sensor_
                        : stage_ == Stage::calibrate_second ? second_sensor_
                                                            : sensor_;
  sensor = {calibration_->sensitivity(), calibration_->sensitivityStd(), calibration_->bendGap(),
            calibration_->bendGapStd(), calibration_->volt()};
  const bool held_back = calibration_->heldBack();
  calibration_.reset();
  say(formatted("sensor calibrated: %.3f +- %.3f um/V", 1e6 * sensor.sensitivity,
                1e6 * sensor.sensitivity_std) +
          (held_back ? formatted(" at %.2f V, held back by the tool's edges", sensor.volt) : std::string()),
      stage_ == Stage::calibrate         ? 0.62
      : stage_ == Stage::calibrate_cross ? 0.66
      : stage_ == Stage::calibrate_again ? 0.7
                                         : 0.87);
  if (stage_ == Stage::calibrate && has_cross_) {
    stage_ = Stage::calibrate_cross;
    return average(now + parameters_.settle_time);
  }
  if (stage_ == Stage::calibrate_cross) {
    stage_ = Stage::calibrate_again;
    return average(now + parameters_.settle_time);
  }
  if (stage_ != Stage::calibrate_second) {
    result_.sensitivity = sensor_.sensitivity;
    result_.sensitivity_std = sensor_.sensitivity_std;
  }
  stage_ = Stage::strike;
  strike(now);
}

void HammerSequence::crossFailed(double now) {
  no_cross_ = calibration_->reason();
  calibration_.reset();
  stage_ = Stage::calibrate_again;
  say("no cross FRF: " + no_cross_, 0.66);
  average(now + parameters_.settle_time);
}

void HammerSequence::fluteFound(double now) {
  const double half = roundTo(0.5 * station_.offset, parameters_.resolution);
  if (stage_ == Stage::search_low) {
    result_.flute_low = search_->angle();
    result_.flute_sure = search_->sure();
    approach_.fluteSeen(search_->readings(), search_->angle(), search_->volt());
    stage_ = Stage::to_height;
    say("lowering the tool to find the flute halfway up to the hammer", 0.28);
    return jog(now, "z", -half, parameters_.approach_feed);
  }
  // Another flute may have been nearer to the walk: the one meant is within half a pitch of where the helix
  // puts it.
  result_.flute_high = search_->angle();
  result_.flute_sure *= search_->sure();
  const double full_pitch = units::TWO_PI / (goal_.teeth > 0 ? goal_.teeth : tool_.teeth);
  result_.flute_high -= full_pitch * std::round((result_.flute_high - expected_angle_) / full_pitch);
  result_.flute_hammer = 2.0 * result_.flute_high - result_.flute_low;  // eq. 4.1
  stage_ = Stage::to_tip;
  say(formatted("flute at %.2f deg at the tip, %.2f deg halfway up, %.2f deg at the hammer",
                units::degFromRad(result_.flute_low), units::degFromRad(result_.flute_high),
                units::degFromRad(result_.flute_hammer)) +
          formatted(", sure by %.1f %%, %d spindle moves", 100.0 * result_.flute_sure, result_.spindle_moves),
      0.48);
  jog(now, "z", half, parameters_.approach_feed);
}

}  // namespace hammer
}  // namespace smartmill
