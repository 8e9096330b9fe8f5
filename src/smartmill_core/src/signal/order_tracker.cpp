#include "smartmill_core/signal/order_tracker.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;

constexpr std::size_t PIECES = 8;       // of a window: six degrees of freedom for the scatter
constexpr double TOOTH_PERIODS = 16.0;  // in a window, two in each piece, so that other orders average out
constexpr double GRID = 0.25;           // [1] of the resolution of a window, between searched frequencies

}  // namespace

void OrderTracker::setCut(double speed, std::size_t teeth) {
  const bool known = std::isfinite(speed) && speed > 0.0 && teeth > 0;
  // Another speed or tool, not the ripple of the controller's reading.
  if (!known || teeth != teeth_ || std::abs(speed - speed_) > 0.5 * parameters_.search * speed_) unlock();
  speed_ = known ? speed : 0.0;
  teeth_ = known ? teeth : 0;
}

void OrderTracker::unlock() {
  locked_ = false;
}

std::optional<OrderTracker::Reading> OrderTracker::push(const SampleBlock& block, std::size_t channel) {
  const bool follows = next_index_ && block.first_index == *next_index_ && block.sample_rate == rate_;
  if (!follows) {
    samples_.clear();
    unlock();
  }
  rate_ = block.sample_rate;
  next_index_ = block.first_index + block.size();
  for (std::size_t i = 0; i < block.size(); ++i) {
    const double value = block.at(i, channel);
    if (std::isfinite(value)) {
      samples_.push_back(value);
    } else {
      samples_.clear();
      unlock();
    }
  }
  if (teeth_ == 0 || speed_ <= 0.0) {
    samples_.clear();
    return {};
  }
  const double passing = static_cast<double>(teeth_) * speed_ / units::TWO_PI;
  const auto window = static_cast<std::size_t>(rate_ * std::max(parameters_.window, TOOTH_PERIODS / passing));
  if (samples_.size() < window) return {};
  samples_.erase(samples_.begin(), samples_.end() - static_cast<std::ptrdiff_t>(window));

  const double stamp = block.timeOf(block.size() - 1);
  if (!locked_) {
    // A window in which nothing was found differs little from the next one.
    if (stamp < searched_ + GRID * parameters_.window && stamp > searched_) return {};
    searched_ = stamp;
    frequency_ = searched(passing);
  }
  const Line line = lineAt(frequency_);
  const double frequency = line.rate / units::TWO_PI;
  if (line.share < parameters_.least_share || !(line.scatter < parameters_.largest_scatter) ||
      std::abs(frequency - passing) > 2.0 * parameters_.search * passing) {
    unlock();
    return {};
  }
  const auto teeth = static_cast<double>(teeth_);
  if (locked_) {
    const double expected = turned_ + units::TWO_PI * frequency_ * (stamp - stamp_);
    turned_ = nearAngle(line.phase, expected);
  } else {
    locked_ = true;
    ++locks_;
    turned_ = line.phase;
  }
  stamp_ = stamp;
  frequency_ = frequency;
  return Reading{
      {stamp, wrapped(turned_ / teeth), line.rate / teeth}, line.phase_std / teeth, line.rate_std / teeth};
}

double OrderTracker::searched(double frequency) const {
  const double step = GRID * rate_ / static_cast<double>(samples_.size());
  double best = frequency, most = -1.0;
  const double reach = parameters_.search * frequency;
  for (double f = frequency - reach; f <= frequency + reach; f += step) {
    const double own = power(f);
    if (own > most) {
      most = own;
      best = f;
    }
  }
  return best;
}

double OrderTracker::power(double frequency) const {
  const Complex turn = std::polar(1.0, -units::TWO_PI * frequency / rate_);
  Complex sum = 0.0, at = 1.0;
  for (const double value : samples_) {
    sum += value * at;
    at *= turn;
  }
  return std::norm(sum);
}

OrderTracker::Line OrderTracker::lineAt(double frequency) const {
  const std::size_t size = samples_.size(), piece = size / PIECES;
  double level = 0.0, squares = 0.0;
  for (const double value : samples_) level += value;
  level /= static_cast<double>(size);
  // Times are counted from the newest sample.
  std::vector<double> times, phases;
  Complex sum = 0.0;
  for (std::size_t p = 0; p < PIECES; ++p) {
    const std::size_t begin = size - (PIECES - p) * piece;
    const Complex turn = std::polar(1.0, -units::TWO_PI * frequency / rate_);
    Complex at = std::polar(1.0, -units::TWO_PI * frequency *
                                     (static_cast<double>(begin) - static_cast<double>(size - 1)) / rate_);
    Complex own = 0.0;
    for (std::size_t i = begin; i < begin + piece; ++i, at *= turn) own += (samples_[i] - level) * at;
    sum += own;
    times.push_back(
        (static_cast<double>(begin) + 0.5 * static_cast<double>(piece - 1) - static_cast<double>(size - 1)) /
        rate_);
    phases.push_back(p > 0 ? nearAngle(std::arg(own), phases.back()) : std::arg(own));
  }
  for (const double value : samples_) squares += (value - level) * (value - level);

  const double middle = mean(times), average = mean(phases);
  double spread = 0.0, product = 0.0;
  for (std::size_t p = 0; p < PIECES; ++p) {
    spread += (times[p] - middle) * (times[p] - middle);
    product += (times[p] - middle) * (phases[p] - average);
  }
  const double slope = product / spread;
  double residual = 0.0;
  for (std::size_t p = 0; p < PIECES; ++p)
    residual += std::pow(phases[p] - average - slope * (times[p] - middle), 2);
  const double freedom = static_cast<double>(PIECES) - 2.0;
  Line line{};
  line.scatter = std::sqrt(residual / freedom);
  const double scatter = studentOverNormal(freedom) * line.scatter;
  // At the newest sample, where the demodulating oscillation has phase 0.
  line.phase = average - slope * middle;
  line.rate = units::TWO_PI * frequency + slope;
  line.phase_std = scatter * std::sqrt(1.0 / static_cast<double>(PIECES) + middle * middle / spread);
  line.rate_std = scatter / std::sqrt(spread);
  line.share = squares > 0.0 ? 2.0 * std::norm(sum) / (static_cast<double>(size) * squares) : 0.0;
  return line;
}

}  // namespace smartmill
