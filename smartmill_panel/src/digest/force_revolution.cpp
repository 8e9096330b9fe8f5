#include "smartmill_panel/digest/force_revolution.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/units.h"

namespace smartmill::panel {
namespace {

constexpr float NO_FORCE = std::numeric_limits<float>::quiet_NaN();

}  // namespace

RevolutionMaker::RevolutionMaker(const RevolutionParameters& parameters)
    : bins_(static_cast<std::size_t>(parameters.bins)) {
  checkBounds(parameters);
  reset();
}

void RevolutionMaker::reset() {
  turned_ = 0.0;
  sum_.assign(3 * bins_, 0.0);
  low_.assign(3 * bins_, NO_FORCE);
  high_ = low_;
  count_.assign(3 * bins_, 0);
}

void RevolutionMaker::push(const ForceBlock& block, const AngleTrack& angle) {
  constexpr double LEAST_SPEED = 1.0;  // [rad/s] below it the spindle counts as stopped
  if (angle.speed() < LEAST_SPEED) return;
  speed_ = angle.speed();
  const std::size_t size = block.force[0].size();
  for (std::size_t i = 0; i < size; ++i) {
    const double time = block.stamp + static_cast<double>(i) / block.sample_rate;
    const std::optional<double> at = angle.at(time);
    if (!at) continue;
    const auto bin =
        std::min(static_cast<std::size_t>(*at / units::TWO_PI * static_cast<double>(bins_)), bins_ - 1);
    for (std::size_t a = 0; a < 3; ++a) {
      const double value = block.force[a][i];
      if (std::isnan(value)) continue;
      const std::size_t place = a * bins_ + bin;
      const auto single = static_cast<float>(value);
      if (count_[place]++ == 0) low_[place] = high_[place] = single;
      sum_[place] += value;
      low_[place] = std::min(low_[place], single);
      high_[place] = std::max(high_[place], single);
    }
    turned_ += speed_ / block.sample_rate;
    stamp_ = time;
  }
}

std::optional<ForceRevolution> RevolutionMaker::take() {
  if (turned_ < units::TWO_PI) return {};
  ForceRevolution result;
  result.stamp = stamp_;
  result.spindle_speed = speed_;
  result.revolutions = turned_ / units::TWO_PI;
  result.bins = bins_;
  result.low = low_;
  result.high = high_;
  for (std::size_t k = 0; k < sum_.size(); ++k)
    result.mean.push_back(count_[k] > 0 ? static_cast<float>(sum_[k] / count_[k]) : NO_FORCE);
  reset();
  return result;
}

}  // namespace smartmill::panel
