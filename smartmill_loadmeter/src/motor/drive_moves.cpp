#include "smartmill_loadmeter/motor/drive_moves.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/axis_names.h"

namespace smartmill::loadmeter {

DriveMoves::DriveMoves(const MotorParameters& parameters, const std::optional<MachineAxes>& axes,
                       const DriveMoveOptions& options)
    : parameters_(parameters), options_(options), limits_(axes) {
}

void DriveMoves::clear() {
  axes_ = {};
  last_ = {};
  last_state_ = 0.0;
  for (auto& samples : samples_) samples.clear();
  rate_ = 0.0;
}

void DriveMoves::handle(const CncState& state) {
  if (!limits_ || rate_ == 0.0) return;
  const bool gap = state.stamp - last_state_ > options_.largest_gap;
  for (std::size_t a = 0; a < 3; ++a) {
    const std::optional<std::size_t> at = controllerAxis(state.axes, a);
    if (!at || *at >= state.position.size()) return;
    Axis& axis = axes_[a];
    const double moved = std::abs(state.position[*at] - axis.position);
    if (gap) {
      axis.moving = moved > options_.rest_tolerance && last_state_ > 0.0;
      axis.begin = -1.0;  // start not observed
    } else if (moved > options_.rest_tolerance && !axis.moving) {
      axis.moving = true;
      axis.begin = last_state_;
      axis.from = axis.position;
    } else if (moved <= options_.rest_tolerance && axis.moving) {
      axis.moving = false;
      if (axis.begin >= 0.0) {
        last_[a] = {axis.begin, last_state_, std::abs(axis.position - axis.from)};
        if (axis.bandwidths.size() + axis.waiting.size() < options_.most_moves)
          axis.waiting.push_back(last_[a]);
      }
    }
    axis.position = state.position[*at];
  }
  last_state_ = state.stamp;
}

void DriveMoves::handle(const SampleBlock& block) {
  if (!limits_ || block.size() == 0) return;
  if (block.first_index != next_ || block.sample_rate != rate_) {
    for (auto& samples : samples_) samples.clear();
    for (Axis& axis : axes_) axis.waiting.clear();
    rate_ = block.sample_rate;
    start_ = block.stamp;
  }
  next_ = block.first_index + block.size();
  for (std::size_t a = 0; a < 3; ++a) {
    const auto found = std::find(block.channels.begin(), block.channels.end(), AXIS_NAMES[a]);
    if (found == block.channels.end()) continue;
    const auto channel = static_cast<std::size_t>(found - block.channels.begin());
    for (std::size_t i = 0; i < block.size(); ++i) samples_[a].push_back(block.at(i, channel));
    const auto most = static_cast<std::size_t>(options_.stored * rate_);
    while (samples_[a].size() > most) samples_[a].pop_front();
  }
  const std::size_t kept = std::max({samples_[0].size(), samples_[1].size(), samples_[2].size()});
  start_ = block.timeOf(block.size()) - static_cast<double>(kept) / rate_;
  evaluateWaiting();
}

void DriveMoves::evaluateWaiting() {
  for (std::size_t a = 0; a < 3; ++a) {
    const double until = start_ + static_cast<double>(samples_[a].size()) / rate_;
    // Axes of one line stop together, so that all their moves are known by then.
    auto& waiting = axes_[a].waiting;
    while (!waiting.empty() && waiting.front().end + options_.after < until) {
      const Move move = waiting.front();
      waiting.erase(waiting.begin());
      identifyMove(a, move);
    }
  }
}

void DriveMoves::identifyMove(std::size_t axis, const Move& move) {
  const double per_metre = parameters_.phase_per_metre[axis];
  if (!(per_metre > 0.0) || move.begin - options_.before < start_) return;
  // In rapid traverse all axes follow one line.
  double length = 0.0;
  for (const Move& other : last_) {
    const bool same = std::abs(other.begin - move.begin) < options_.largest_gap &&
                      std::abs(other.end - move.end) < options_.largest_gap;
    if (same) length += other.distance * other.distance;
  }
  length = std::sqrt(length);
  if (!(length > 0.0)) return;
  const double share = move.distance / length,
               fastest = std::min(limits_->rapid, std::sqrt(length * limits_->acceleration));
  const double duration = length / fastest + fastest / limits_->acceleration;
  if (std::abs(move.end - move.begin - duration) > options_.duration_tolerance) return;
  DriveMove one;
  one.sample_rate = rate_;
  const double from = move.begin - options_.before;
  const auto first = static_cast<std::ptrdiff_t>((from - start_) * rate_),
             last = static_cast<std::ptrdiff_t>((move.end + options_.after - start_) * rate_);
  one.current.assign(samples_[axis].begin() + first, samples_[axis].begin() + last);
  // The start lies between two states.
  one.begin =
      move.begin - start_ - static_cast<double>(first) / rate_ + 0.5 * (move.end - move.begin - duration);
  one.distance = move.distance;
  one.velocity = limits_->rapid * share;
  one.acceleration = limits_->acceleration * share;
  const auto response = identifyResponse(one, per_metre);
  if (!response) return;
  axes_[axis].bandwidths.push_back(response->bandwidth);
  axes_[axis].bandwidth = weightedMean(axes_[axis].bandwidths);
}

}  // namespace smartmill::loadmeter
