#include "smartmill_exchange/items/force_features.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::exchange {
namespace {

double endOf(const ForceBlock& block) {
  return block.stamp + static_cast<double>(block.force[0].size()) / block.sample_rate;
}

}  // namespace

void ForceFeatureMaker::push(const SpindleAngle& angle) {
  if (angle.stamp < angle_.newest() - AngleTrack::HISTORY) reset();
  angle_.push(angle);
  while (!waiting_.empty() && endOf(waiting_.front()) <= angle_.newest()) {
    process(waiting_.front());
    waiting_.pop_front();
  }
}

void ForceFeatureMaker::push(const ForceBlock& block) {
  waiting_.push_back(block);
  while (!waiting_.empty() &&
         (endOf(waiting_.front()) <= angle_.newest() || endOf(block) - endOf(waiting_.front()) > PATIENCE)) {
    process(waiting_.front());
    waiting_.pop_front();
  }
}

void ForceFeatureMaker::setTool(int teeth, double middle) {
  if (teeth == teeth_ && middle == middle_) return;
  teeth_ = teeth;
  middle_ = middle;
  whole_ = false;
  last_angle_.reset();
  revolution_ = sums_ = noSums();
}

void ForceFeatureMaker::reset() {
  angle_ = AngleTrack();
  waiting_.clear();
  whole_ = false;
  last_angle_.reset();
  revolution_ = sums_ = noSums();
  results_.clear();
}

std::vector<ForceFeatures> ForceFeatureMaker::take() {
  return std::move(results_);
}

ForceFeatureMaker::Sums ForceFeatureMaker::noSums() const {
  Sums sums;
  sums.peak_of_tooth.assign(static_cast<std::size_t>(std::max(teeth_, 0)), 0.0);
  return sums;
}

void ForceFeatureMaker::process(const ForceBlock& block) {
  constexpr double LEAST_SPEED = 1.0;  // [rad/s] below it the spindle counts as stopped
  for (std::size_t i = 0; i < block.force[0].size(); ++i) {
    const double time = block.stamp + static_cast<double>(i) / block.sample_rate;
    const std::optional<double> angle = angle_.speed() < LEAST_SPEED ? std::nullopt : angle_.at(time);
    if (!angle) {
      last_angle_.reset();
      whole_ = false;
      continue;
    }
    // The angle falls by nearly a revolution where the next one begins; by less, readings have been
    // corrected.
    if (last_angle_ && *angle < *last_angle_ - units::PI) {
      if (whole_) endRevolution(time);
      whole_ = true;
      revolution_ = noSums();
      if (sums_.revolutions == 0) began_ = time;
    }
    last_angle_ = angle;
    add(*angle, {block.force[0][i], block.force[1][i], block.force[2][i]});
  }
}

void ForceFeatureMaker::add(double angle, const std::array<double, 3>& force) {
  Sums& sums = revolution_;
  const double in_plane = std::hypot(force[0], force[1]);
  if (std::isnan(in_plane + force[2])) {
    sums.valid = false;
    return;
  }
  ++sums.samples;
  sums.peak = std::max(sums.peak, in_plane);
  for (std::size_t a = 0; a < 3; ++a) {
    sums.largest[a] = std::max(sums.largest[a], std::abs(force[a]));
    sums.squares[a] += force[a] * force[a];
  }
  if (teeth_ < 1) return;
  // Tooth j is ahead of the first by j pitches; the sample belongs to the tooth nearest to the middle of the
  // engagement.
  const double pitch = units::TWO_PI / teeth_;
  const auto tooth =
      static_cast<std::size_t>(wrapped(middle_ - angle + 0.5 * pitch) / pitch) % sums.peak_of_tooth.size();
  sums.peak_of_tooth[tooth] = std::max(sums.peak_of_tooth[tooth], in_plane);
}

void ForceFeatureMaker::endRevolution(double stamp) {
  if (revolution_.valid && revolution_.samples > 0) {
    sums_.peak = std::max(sums_.peak, revolution_.peak);
    for (std::size_t a = 0; a < 3; ++a) {
      sums_.largest[a] = std::max(sums_.largest[a], revolution_.largest[a]);
      sums_.squares[a] += revolution_.squares[a];
    }
    for (std::size_t k = 0; k < sums_.peak_of_tooth.size(); ++k)
      sums_.peak_of_tooth[k] = std::max(sums_.peak_of_tooth[k], revolution_.peak_of_tooth[k]);
    sums_.samples += revolution_.samples;
    ++sums_.revolutions;
  }
  if (sums_.revolutions == 0 || stamp - began_ < interval_) return;
  ForceFeatures features{stamp, sums_.revolutions, sums_.peak, sums_.largest, {}, sums_.peak_of_tooth};
  for (std::size_t a = 0; a < 3; ++a)
    features.rms[a] = std::sqrt(sums_.squares[a] / static_cast<double>(sums_.samples));
  results_.push_back(features);
  sums_ = noSums();
}

}  // namespace smartmill::exchange
