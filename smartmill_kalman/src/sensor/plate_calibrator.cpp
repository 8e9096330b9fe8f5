#include "smartmill_kalman/sensor/plate_calibrator.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {

using Code = CalibrationResult::Code;

CalibrationResult PlateCalibrator::handle(const CalibrationGoal& goal) {
  CalibrationResult result;
  if (goal.step == CalibrationGoal::Step::forget) reset();
  if (goal.step == CalibrationGoal::Step::point) {
    const bool finite =
        std::all_of(goal.load.begin(), goal.load.end(), [](double v) { return std::isfinite(v); });
    if (!finite) {
      result.code = Code::bad_goal;
      result.message = "point: expected finite numbers";
      return result;
    }
    point_ = goal.load;
    result.message = formatted("taps of kalman/measure_frf are now at %.1f %.1f %.1f mm",
                               goal.load[0] / units::MM, goal.load[1] / units::MM, goal.load[2] / units::MM);
  } else if (goal.step == CalibrationGoal::Step::fit) {
    try {
      TransferMatrix matrix = identifyTransferMatrix(records_.taps, records_.rate);
      std::set<std::array<double, 3>> points;
      for (const MatrixTap& tap : records_.taps) points.insert(tap.point);
      result.message =
          formatted("%zu taps at %zu points: matrix of %zu channels, condition %.1f (median of %zu lines)",
                    records_.taps.size(), points.size(), matrix.channels, median(matrix.condition),
                    matrix.frequency.size());
      result.matrix = std::move(matrix);
    } catch (const Error& e) {
      result.code = Code::fit_failed;
      result.message = e.what();
    }
  }
  result.readings = records_.taps.size();
  return result;
}

void PlateCalibrator::handle(const SampleBlock& block) {
  if (!collector_) return;
  if (columns_.empty()) {
    const bool six =
        std::find(block.channels.begin(), block.channels.end(), PLATE_CHANNELS[3]) != block.channels.end();
    for (std::size_t c = 0; c < (six ? 6 : 3); ++c) columns_.push_back(block.channel(PLATE_CHANNELS[c]));
    collector_.emplace(parameters_, columns_.size());
    collector_->begin();
  }
  for (std::size_t i = 0; i < block.size(); ++i) {
    std::vector<double> values;
    for (const std::size_t c : columns_) values.push_back(block.at(i, c));
    collector_->add(block.timeOf(i), block.first_index + i, block.sample_rate, std::move(values));
  }
}

void PlateCalibrator::handleHammer(const SampleBlock& block) {
  if (collector_) collector_->handleHammer(block);
}

void PlateCalibrator::beginTaps(const std::string& direction) {
  if (!point_) return;
  direction_ = direction;
  columns_.clear();  // from the first block
  collector_.emplace(parameters_, 0);
}

void PlateCalibrator::endTaps(const SensorResult& result) {
  if (!collector_) return;
  const std::optional<std::size_t> axis = axisIndex(direction_);
  if (result.code == FrfCode::ok && axis) {
    if (records_.rate != collector_->rate())
      records_ = {{}, collector_->rate()};  // another sample rate: another device
    for (std::vector<Hit>& hit : collector_->acceptedHits(result)) {
      MatrixTap tap;
      tap.point = *point_;
      // The sensor gives the direction of the hit.
      tap.direction[*axis] = result.static_gain < 0.0 ? -1.0 : 1.0;
      tap.hammer = std::move(hit[0].force);
      for (Hit& channel : hit) tap.channels.push_back(std::move(channel.response));
      records_.taps.push_back(std::move(tap));
    }
  }
  collector_.reset();
}

}  // namespace smartmill::kalman
