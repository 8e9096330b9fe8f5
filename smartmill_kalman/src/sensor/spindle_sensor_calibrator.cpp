#include "smartmill_kalman/sensor/spindle_sensor_calibrator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/same_time.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/sensor/spindle_force_sensor.h"

namespace smartmill::kalman {
namespace {

using Code = CalibrationResult::Code;

}  // namespace

SpindleSensorCalibrator::SpindleSensorCalibrator(const TapParameters& taps,
                                                 const SpindleSensorCalibration& base)
    : parameters_(taps), base_(base), collector_(taps, 3) {
  measurements_.file = "measurements";
  reference_.file = "reference measurements";
}

void SpindleSensorCalibrator::reset() {
  *this = SpindleSensorCalibrator(parameters_, base_);
}

std::optional<CalibrationResult> SpindleSensorCalibrator::takeResult() {
  return std::exchange(result_, std::nullopt);
}

void SpindleSensorCalibrator::finish(Code code, const std::string& message) {
  CalibrationResult result;
  result.code = code;
  result.message = message;
  result.readings = measurements_.size();
  goal_.reset();
  result_ = result;
}

void SpindleSensorCalibrator::cancel() {
  if (goal_) finish(Code::cancelled, "cancelled");
}

bool SpindleSensorCalibrator::handle(const CalibrationGoal& goal) {
  if (goal_) return false;
  if (goal.step == CalibrationGoal::Step::fit) {
    fit();
  } else if (goal.step == CalibrationGoal::Step::verify) {
    verify();
  } else if (goal.step == CalibrationGoal::Step::forget) {
    reset();
    finish(Code::ok, "measurements and taps were deleted");
  } else if (!(goal.length > 0.0)) {
    finish(Code::bad_goal, formatted("length %g m: expected above 0", goal.length));
  } else if (!(goal.duration > 0.0 && goal.duration <= 60.0)) {
    finish(Code::bad_goal, formatted("duration %g s: expected above 0, at most 60", goal.duration));
  } else if (!(std::isfinite(goal.load[0]) && std::isfinite(goal.load[1]) && std::isfinite(goal.load[2]))) {
    finish(Code::bad_goal, "load: expected finite numbers");
  } else {
    goal_ = goal;
    sum_ = {};
    time_sum_ = 0.0;
    count_ = 0;
    next_index_.reset();
  }
  return true;
}

void SpindleSensorCalibrator::handle(const SampleBlock& block) {
  const std::array<std::size_t, 6> column = SpindleForceSensor::columnsOf(block);
  if (goal_) addSamples(block, column);
  if (direction_.empty()) return;
  for (std::size_t i = 0; i < block.size(); ++i) {
    std::array<double, 6> sensors{};
    for (std::size_t k = 0; k < 6; ++k) sensors[k] = block.at(i, column[k]);
    const auto means = pairMeans(sensors);
    collector_.add(block.timeOf(i), block.first_index + i, block.sample_rate, {means.begin(), means.end()});
  }
}

void SpindleSensorCalibrator::addSamples(const SampleBlock& block, const std::array<std::size_t, 6>& column) {
  const auto wanted_count = static_cast<std::size_t>(std::ceil(goal_->duration * block.sample_rate));
  for (std::size_t i = 0; i < block.size(); ++i) {
    const double time = block.timeOf(i);
    if (time < goal_->stamp - SAME_TIME) continue;
    if (next_index_ && *next_index_ != block.first_index + i)
      return finish(Code::bad_data, "samples were lost during the measurement");
    next_index_ = block.first_index + i + 1;
    for (std::size_t k = 0; k < 6; ++k) sum_[k] += block.at(i, column[k]);
    time_sum_ += time;
    if (++count_ < wanted_count) continue;
    const double n = static_cast<double>(count_);
    std::array<double, 6> mean{};
    for (std::size_t k = 0; k < 6; ++k) mean[k] = sum_[k] / n;
    for (std::size_t k = 0; k < 6; ++k) {
      if (!std::isfinite(mean[k])) {
        return finish(Code::bad_data, formatted("channel %s: not finite", SPINDLE_SENSOR_CHANNELS[k]));
      }
    }
    StaticMeasurements& to = goal_->reference ? reference_ : measurements_;
    to.test.push_back(goal_->test);
    to.time.push_back(time_sum_ / n);
    to.length.push_back(goal_->length);
    to.load.push_back(goal_->load);
    to.sensors.push_back(mean);
    if (!(tap_length_ > 0.0)) tap_length_ = goal_->length;
    return finish(Code::ok, formatted("measurement %zu: %.2f %.2f %.2f %.2f %.2f %.2f N", to.size(), mean[0],
                                      mean[1], mean[2], mean[3], mean[4], mean[5]));
  }
}

void SpindleSensorCalibrator::handleHammer(const SampleBlock& block) {
  collector_.handleHammer(block);
}

void SpindleSensorCalibrator::beginTaps(const std::string& direction, double length) {
  direction_ = direction;
  if (length > 0.0) tap_length_ = length;
  if (direction.empty()) {
    collector_.end();
  } else {
    collector_.begin();
  }
}

void SpindleSensorCalibrator::endTaps(const SensorResult& result) {
  const std::optional<std::size_t> along = axisIndex(direction_);
  if (along && result.code == FrfCode::ok) {
    taps_[*along].clear();
    tap_rate_ = collector_.rate();
    for (const std::vector<Hit>& hit : collector_.acceptedHits(result))
      taps_[*along].push_back({hit[0].response, hit[1].response, hit[2].response});
  }
  beginTaps("");
}

/// Dynamic cross-talk from the taps. @return its description, for the message
std::string SpindleSensorCalibrator::fitDynamicCrossTalks(SpindleSensorCalibration& c) const {
  std::string text;
  const auto fit_one = [&](std::size_t along, std::size_t in, const std::optional<LengthDependence>& line,
                           ModalModel& model, const char* name) {
    const auto& taps = taps_[along];
    if (taps.empty() || !line) return;
    const double constant = along == 0 ? c.x.at(tap_length_) : c.y.at(tap_length_);
    std::vector<std::vector<double>> force, cross;
    for (const auto& tap : taps) {
      force.push_back(tap[along]);
      cross.push_back(tap[in]);
      for (std::vector<double>* record : {&force.back(), &cross.back()}) {
        double zero = 0.0;
        const auto quiet = static_cast<std::size_t>(0.75 * parameters_.pre_trigger * tap_rate_);
        for (std::size_t i = 0; i < quiet; ++i) zero += record->at(i) / static_cast<double>(quiet);
        for (double& v : *record) v -= zero;
      }
      for (double& v : force.back()) v *= constant;
    }
    try {
      model = fitDynamicCrossTalk(force, cross, line->at(tap_length_), tap_rate_, parameters_.fit_low,
                                  parameters_.fit_high, parameters_.max_modes);
      text += formatted(", %s with %zu modes", name, model.modes.size());
    } catch (const Error&) {
      text += std::string(", ") + name + " static only";
    }
  };
  fit_one(1, 0, c.yx, c.dynamic_yx, "yx");
  fit_one(1, 2, c.yz, c.dynamic_yz, "yz");
  fit_one(0, 2, c.xz, c.dynamic_xz, "xz");
  return text;
}

std::string SpindleSensorCalibrator::measurementTable() const {
  std::string out =
      "test,time[s],length[mm],load_x[N],load_y[N],load_z[N],x1[N],x2[N],y1[N],y2[N],z1[N],z2[N]\n";
  for (std::size_t i = 0; i < measurements_.size(); ++i) {
    out += formatted("%d,%.9g,%.9g", measurements_.test[i], measurements_.time[i] - measurements_.time[0],
                     measurements_.length[i] / units::MM);
    for (const double load : measurements_.load[i]) out += formatted(",%.9g", load);
    for (const double sensor : measurements_.sensors[i]) out += formatted(",%.9g", sensor);
    out += "\n";
  }
  return out;
}

void SpindleSensorCalibrator::fit() {
  try {
    StaticCalibration found = calibrateStatic(measurements_, base_);
    const std::string dynamics = fitDynamicCrossTalks(found.calibration);
    const SpindleSensorCalibration& c = found.calibration;
    const CalibrationResult described = describe(c, tap_length_);
    finish(Code::ok,
           formatted("%zu measurements at %zu lengths: ", measurements_.size(), found.lengths.size()) +
               described.message + dynamics);
    result_->constant = described.constant;
    result_->constant_std = described.constant_std;
    result_->error = described.error;
    result_->calibration = c;
    base_ = c;
  } catch (const Error& e) {
    finish(Code::fit_failed, e.what());
  }
}

CalibrationResult SpindleSensorCalibrator::describe(const SpindleSensorCalibration& calibration,
                                                    double length) {
  CalibrationResult result;
  const std::array<const LengthDependence*, 3> lines{{&calibration.x, &calibration.y, &calibration.z}};
  result.message = "constants";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result.constant[axis] = lines[axis]->at(length);
    result.constant_std[axis] = lines[axis]->stdAt(length);
    result.error[axis] = result.constant_std[axis] / std::abs(result.constant[axis]);
    result.message += formatted("%s %s %.3f", axis > 0 ? "," : "", AXIS_NAMES[axis], result.constant[axis]);
    if (std::isfinite(result.constant_std[axis]))
      result.message += formatted(" +- %.3f", result.constant_std[axis]);
  }
  result.message += formatted(" at %.0f mm", length / units::MM);
  return result;
}

void SpindleSensorCalibrator::verify() {
  try {
    const auto error = verifyStatic(reference_, base_);
    const bool good = *std::max_element(error.begin(), error.end()) <= LARGEST_STATIC_ERROR;
    finish(good ? Code::ok : Code::fit_failed,
           formatted("largest difference from the reference x %.2f, y %.2f, z %.2f %% (limit %.0f)",
                     100.0 * error[0], 100.0 * error[1], 100.0 * error[2], 100.0 * LARGEST_STATIC_ERROR));
    result_->readings = reference_.size();
    result_->error = error;
    result_->verified = true;
  } catch (const Error& e) {
    finish(Code::fit_failed, e.what());
  }
}

}  // namespace smartmill::kalman
