#include "smartmill_sim/twin/tool_history.h"

#include <cmath>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/math/angle.h"

namespace smartmill::sim {
namespace {

constexpr std::size_t LEAST_HISTORY = 4096, MOST_HISTORY = 131072;  // steps; powers of two
constexpr double SAME_TURN = 1e-10;                                 // [rad]
constexpr double SETTLED_STEPS = 3.0;  // steps of a regime before it counts as steady

}  // namespace

std::array<double, 2> feedOf(const ToolMotion& motion) {
  if (!(motion.speed > 0.0)) throw Error("milling: the spindle is at rest");
  return {{motion.velocity[0] / motion.speed, motion.velocity[1] / motion.speed}};
}

void ToolHistory::clear(const ToolMotion& now) {
  displacement_.assign(LEAST_HISTORY, {{0.0, 0.0}});
  centre_.assign(LEAST_HISTORY, {{0.0, 0.0}});
  rotation_.assign(LEAST_HISTORY, 0.0);
  count_ = 0;
  rotation_now_ = 0.0;
  longest_delay_ = 0;
  largest_deflection_ = largest_change_ = {{0.0, 0.0}};
  regime_ = 0;
  regime_start_ = 0.0;
  now_ = now;
  first_feed_ = feed_;
  delays_.clear();
}

void ToolHistory::advance(const ToolMotion& now) {
  if (count_ > 0) rotation_now_ += wrapped(now.angle - now_.angle);
  if (now.speed != now_.speed || now.velocity != now_.velocity || now.sink != now_.sink) {
    ++regime_;
    regime_start_ = rotation_now_;
    feed_ = feedOf(now);
  }
  now_ = now;
  largest_slope_ = std::max(largest_change_[0], largest_change_[1]) / (now.speed * time_step_);
}

bool ToolHistory::isSteadyOver(double turn) const {
  return regime_ == 0 || rotation_now_ - regime_start_ > turn + SETTLED_STEPS * now_.speed * time_step_;
}

ToolHistory::Point ToolHistory::Point::at(double steps) {
  steps = std::max(2.0, steps);
  const auto whole_steps = static_cast<std::size_t>(steps);
  const double f = steps - static_cast<double>(whole_steps), g = f - 1.0, h = f - 2.0, across = (f + 1.0) * f;
  return {
      steps, whole_steps, {{across * g / 6.0, -across * h / 2.0, (f + 1.0) * g * h / 2.0, -f * g * h / 6.0}}};
}

std::array<double, 4> ToolHistory::Point::weightSlopes() const {
  const double f = ago - static_cast<double>(steps), square = 3.0 * f * f;
  return {{(square - 1.0) / 6.0, (2.0 + 2.0 * f - square) / 2.0, (square - 4.0 * f - 1.0) / 2.0,
           (6.0 * f - square - 2.0) / 6.0}};
}

/// Finds the interpolation point of a delay in a history of changing speed or feed.
void ToolHistory::search(Delay& delay) {
  const double target = rotation_now_ - delay.turn;
  const long available = std::min(count_, static_cast<long>(rotation_.size()));
  const auto rotationAt = [&](long ago) {
    return ago == 0 ? rotation_now_ : rotation_[ring(count_ - ago, rotation_.size())];
  };
  if (available == 0 || target < rotationAt(available)) {
    // Before the history the tool moved as at its beginning.
    const std::array<double, 2> oldest =
        available == 0 ? now_.centre : centre_[ring(count_ - available, centre_.size())];
    const double before = (available == 0 ? rotation_now_ : rotationAt(available)) - target;
    for (std::size_t i = 0; i < 2; ++i) delay.fed[i] = now_.centre[i] - oldest[i] + first_feed_[i] * before;
    delay.point =
        Point::at(static_cast<double>(available) + std::max(3.0, before / (now_.speed * time_step_)));
    return;
  }
  auto ago = static_cast<long>(delay.turn / (now_.speed * time_step_));
  if (delay.point.steps > 0) ago = static_cast<long>(delay.point.steps) + 1;
  ago = std::clamp(ago, 1L, available);
  while (rotationAt(ago) > target) ++ago;
  while (ago > 1 && rotationAt(ago - 1) <= target) --ago;
  const double at = rotationAt(ago), next = rotationAt(ago - 1);
  delay.point = Point::at(static_cast<double>(ago) - (next > at ? (target - at) / (next - at) : 0.0));
  delay.fed = now_.centre;
  for (std::size_t k = 0; k < 4; ++k) {
    const long step = count_ - static_cast<long>(delay.point.steps) - 2 + static_cast<long>(k);
    const std::array<double, 2>& centre = centre_[ring(std::max(step, count_ - available), centre_.size())];
    for (std::size_t i = 0; i < 2; ++i) delay.fed[i] -= delay.point.weights[k] * centre[i];
  }
}

const ToolHistory::Delay& ToolHistory::update(Delay& delay) {
  delay.updated_at = count_;
  const bool steady = isSteadyOver(delay.turn);
  if (!steady) {
    search(delay);
    delay.valid_regime = -1;
  } else if (delay.valid_regime != regime_) {
    delay.point = Point::at(delay.turn / (now_.speed * time_step_));
    delay.fed = {{feed_[0] * delay.turn, feed_[1] * delay.turn}};
    delay.valid_regime = regime_;
  }
  const auto available = static_cast<std::size_t>(std::min(count_, static_cast<long>(displacement_.size())));
  delay.displacement = {{0.0, 0.0}};
  forEachStep(delay.point, [&](std::size_t k, const std::array<double, 2>& u) {
    for (std::size_t i = 0; i < 2; ++i) delay.displacement[i] += delay.point.weights[k] * u[i];
  });
  delay.within_history = delay.point.steps <= available;
  longest_delay_ = std::max(longest_delay_, delay.point.steps);
  return delay;
}

std::size_t ToolHistory::delayOf(double turn) {
  std::size_t d = 0;
  while (d < delays_.size() && std::abs(delays_[d].turn - turn) > SAME_TURN) ++d;
  if (d == delays_.size()) {
    delays_.emplace_back();
    delays_.back().turn = turn;
  }
  return d;
}

void ToolHistory::endStep(const Vector& displacement, bool with_slope) {
  const std::size_t at = ring(count_, displacement_.size());
  if (at == 0 && count_ > 0) {
    largest_deflection_ = {{0.0, largest_deflection_[0]}};
    largest_change_ = {{0.0, largest_change_[0]}};
  }
  if (with_slope && count_ > 0) {
    const std::array<double, 2>& before = displacement_[ring(count_ - 1, displacement_.size())];
    largest_change_[0] =
        std::max(largest_change_[0], std::hypot(displacement[0] - before[0], displacement[1] - before[1]));
  }
  displacement_[at] = displacement;
  centre_[at] = now_.centre;
  rotation_[at] = rotation_now_;
  const double square = displacement[0] * displacement[0] + displacement[1] * displacement[1];
  if (square > largest_deflection_[0] * largest_deflection_[0]) largest_deflection_[0] = std::sqrt(square);
  ++count_;
  const std::size_t size = displacement_.size();
  if (static_cast<std::size_t>(count_) >= size && size < MOST_HISTORY && 2 * longest_delay_ > size) grow();
}

/// Doubles the length of the full rings.
void ToolHistory::grow() {
  const std::size_t size = displacement_.size();
  const auto wider = [&](auto& old) {
    auto next = old;
    next.resize(2 * size);
    for (long step = count_ - static_cast<long>(size); step < count_; ++step)
      next[ring(step, 2 * size)] = old[ring(step, size)];
    old = std::move(next);
  };
  wider(displacement_);
  wider(centre_);
  wider(rotation_);
}

}  // namespace smartmill::sim
