#include "smartmill_core/signal/pulse_tachometer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr std::size_t ALIKE_PERIODS = 3;  // before the first reading
constexpr std::size_t MOST_PULSES =
    64;                          // of a fit: its cost grows with them, its error falls with their root
constexpr double RESTART = 1.0;  // [s] a time this far behind the last is a backward jump
constexpr std::size_t MOST_ALTERNATING =
    3;  // periods with a double pulse in succession: the period has halved
constexpr std::size_t LEAST_OF_PARABOLA = 5;  // two degrees of freedom
constexpr double SIGNIFICANT = 3.0;           // standard deviations of the curvature
constexpr double WHOLE_SIGMAS =
    3.0;                             // the residuals of the whole window may exceed their expectation by this
constexpr double PART_SIGMAS = 1.0;  // those of a part, which must hide as little as possible
constexpr std::size_t SAFE_SHARE = 3;  // what residuals may hide falls with the third power of the window

/// Least squares k(t) = a + b t (+ c t^2) over the latest pulses, t = 0 at the last.
struct PolynomialFit {
  Eigen::VectorXd value;       // a, b, c
  Eigen::MatrixXd covariance;  // for residuals of variance 1
  double squares = 0.0;        // of the residuals
};

PolynomialFit fitPolynomial(const std::vector<double>& t, const std::vector<double>& k, int degree) {
  const auto rows = static_cast<Eigen::Index>(k.size());
  Eigen::MatrixXd a(rows, degree + 1);
  Eigen::VectorXd b(rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    b[i] = k[static_cast<std::size_t>(i)];
    for (int p = 0; p <= degree; ++p) a(i, p) = std::pow(t[static_cast<std::size_t>(i)], p);
  }
  PolynomialFit fit;
  fit.covariance = linear::inverseSymmetric(Eigen::MatrixXd(a.transpose() * a));
  fit.value = fit.covariance * (a.transpose() * b);
  fit.squares = (b - a * fit.value).squaredNorm();
  return fit;
}

}  // namespace

void PulseTachometerParameters::validate() const {
  checkBounds(*this);
}

std::optional<double> PulseDetector::push(double time, double value) {
  if (!std::isfinite(value)) {
    last_time_.reset();
    return {};
  }
  const double above = (value - parameters_.threshold) * (parameters_.falling ? -1.0 : 1.0);
  std::optional<double> pulse;
  // Without the sample before, the time of the crossing is not known. While ready that sample is below.
  if (above >= 0.0 && ready_ && last_time_)
    pulse = *last_time_ + (time - *last_time_) * last_ / (last_ - above);
  if (above >= 0.0) ready_ = false;
  if (above <= -parameters_.hysteresis) ready_ = true;
  last_time_ = time;
  last_ = above;
  return pulse;
}

PulseTachometer::PulseTachometer(const PulseTachometerParameters& parameters)
    : parameters_((parameters.validate(), parameters)), detector_(parameters) {
}

void PulseTachometer::restart() {
  pulses_.clear();
  refused_.clear();
  alternating_ = 0;
  locked_ = false;
  window_ = 0;
}

std::string PulseTachometer::takeFault() {
  return std::exchange(fault_, {});
}

std::vector<PulseReading> PulseTachometer::push(const SampleBlock& block) {
  const std::size_t column = block.channel(TACHOMETER_CHANNEL);
  if (block.units.at(column) != "V")
    throw Error("sample block: channel tachometer: unit '" + block.units[column] + "', expected 'V'");
  if (next_index_ && *next_index_ != block.first_index) {
    ++counts_.gaps;
    fault(formatted("samples lost before %.3f s: pulses start anew", block.stamp));
    detector_.interrupt();
    restart();
    silent_.reset();
    state_ = State::waiting;
  }
  next_index_ = block.first_index + block.size();
  std::vector<PulseReading> readings;
  // A step of the signal lies anywhere between two samples.
  const double time_std = 1.0 / block.sample_rate / std::sqrt(12.0);
  for (std::size_t i = 0; i < block.size(); ++i) {
    const double value = block.at(i, column), time = block.timeOf(i);
    if (!std::isfinite(value)) {
      if (counts_.not_finite++ == 0 || fault_.empty())
        fault(formatted("a sample at %.3f s is not finite", time));
    }
    const std::optional<double> pulse = detector_.push(time, value);
    if (!pulse) continue;
    if (const auto reading = push(*pulse, time_std)) readings.push_back(*reading);
  }
  if (block.size() == 0) return readings;
  if (const auto rest = waitUntil(block.timeOf(block.size() - 1))) readings.push_back(*rest);
  return readings;
}

/// Whether a pulse continues the pulses so far; missing ones in between are counted.
bool PulseTachometer::isRegular(double time) {
  const double periods = (time - pulses_.back().time) / period_;
  const long turns = std::lround(periods);
  if (turns < 1 || std::abs(periods - static_cast<double>(turns)) > parameters_.period_change) return false;
  if (turns > 1) {
    counts_.missing += static_cast<std::size_t>(turns - 1);
    fault(formatted("%ld pulse%s missing before %.4f s: period %.3f ms, expected %.3f ms", turns - 1,
                    turns == 2 ? " is" : "s are", time, 1e3 * (time - pulses_.back().time), 1e3 * period_));
  }
  pulses_.push_back({pulses_.back().index + turns, time});
  return true;
}

/// Whether the latest periods are alike.
bool PulseTachometer::hasLocked() const {
  if (pulses_.size() <= ALIKE_PERIODS) return false;
  for (std::size_t i = pulses_.size() - ALIKE_PERIODS; i + 1 < pulses_.size(); ++i) {
    const double before = pulses_[i].time - pulses_[i - 1].time;
    const double after = pulses_[i + 1].time - pulses_[i].time;
    if (std::abs(after / before - 1.0) > parameters_.period_change) return false;
  }
  return true;
}

std::optional<PulseReading> PulseTachometer::push(double time, double time_std) {
  if (!(std::isfinite(time) && time_std > 0.0))
    throw Error(
        formatted("pulse: time %g s, standard deviation %g s, expected finite and > 0", time, time_std));
  ++counts_.pulses;
  if (!pulses_.empty() && time < pulses_.back().time - RESTART) {
    fault(formatted("time jumped back to %.3f s: pulses start anew", time));
    restart();
  }
  silent_ = time;
  if (locked_) {
    if (isRegular(time)) {
      alternating_ = refused_.empty() ? 0 : alternating_ + 1;
      refused_.clear();
      if (alternating_ == MOST_ALTERNATING) {
        fault(formatted("every period before %.4f s has a double pulse: pulses start anew", time));
        restart();
        state_ = State::waiting;
        pulses_.push_back({0, time});
        return {};
      }
    } else {
      refused_.push_back(time);
      const bool early = time - pulses_.back().time < period_;
      early ? ++counts_.doubled : ++counts_.irregular;
      fault(formatted("%s pulse at %.4f s: %.3f ms after the last, expected %.3f ms",
                      early ? "double" : "irregular", time, 1e3 * (time - pulses_.back().time),
                      1e3 * period_));
      if (refused_.size() < 2) return {};
      // The period has changed.
      const double last = pulses_.back().time;
      const std::vector<double> times = refused_;
      restart();
      state_ = State::waiting;
      pulses_.push_back({0, last});
      for (const double t : times) pulses_.push_back({pulses_.back().index + 1, t});
      return {};
    }
  } else {
    pulses_.push_back({pulses_.empty() ? 0 : pulses_.back().index + 1, time});
    if (!hasLocked()) {
      if (state_ != State::waiting || pulses_.size() == 1) state_ = State::waiting;
      if (pulses_.size() > ALIKE_PERIODS) {
        ++counts_.irregular;
        fault(formatted("the periods of the pulses before %.4f s differ by more than period_change", time));
        pulses_.pop_front();
      }
      return {};
    }
    locked_ = true;
  }
  const bool doubtful = alternating_ > 0;
  while (pulses_.size() > MOST_PULSES ||
         (pulses_.size() > ALIKE_PERIODS && pulses_.front().time < time - parameters_.longest_window))
    pulses_.pop_front();
  const Fit fit = fitOf(time_std);
  period_ = 1.0 / fit.rate;
  window_ = fit.pulses;
  state_ = State::turning;
  // After a double pulse the next period decides which of them was right.
  if (doubtful) return {};
  return readingOf(fit);
}

PulseTachometer::Fit PulseTachometer::fitOf(double time_std) const {
  const Pulse& last = pulses_.back();
  const auto fitted = [&](std::size_t size, int degree) -> std::pair<Fit, bool> {
    std::vector<double> k, t;
    for (auto pulse = pulses_.end() - static_cast<std::ptrdiff_t>(size); pulse != pulses_.end(); ++pulse) {
      k.push_back(static_cast<double>(pulse->index - last.index));
      t.push_back(pulse->time - last.time);
    }
    // In units of the mean period, for the condition of the matrix.
    const double unit = t.front() / k.front(), k_std = time_std / unit;
    for (double& time : t) time /= unit;
    const PolynomialFit fit = fitPolynomial(t, k, degree);
    const double freedom = static_cast<double>(size) - degree - 1.0;
    const double sigmas = size == pulses_.size() ? WHOLE_SIGMAS : PART_SIGMAS;
    const double most = freedom + sigmas * std::sqrt(2.0 * freedom);
    bool agrees = fit.squares <= most * k_std * k_std;
    if (degree == 2 && agrees && size == pulses_.size())
      agrees = std::abs(fit.value[2]) > SIGNIFICANT * k_std * std::sqrt(fit.covariance(2, 2));
    const double pulses = fit.value[1] / unit;
    return {{fit.value[0], k_std * std::sqrt(fit.covariance(0, 0)), pulses,
             k_std / unit * std::sqrt(fit.covariance(1, 1)), size},
            agrees};
  };
  const std::size_t all = pulses_.size();
  // Constant speed, unless the curvature is significant.
  if (all >= LEAST_OF_PARABOLA) {
    const auto parabola = fitted(all, 2);
    if (parabola.second) return parabola.first;
    const auto line = fitted(all, 1);
    if (line.second) return line.first;
    for (std::size_t size = all - 1; size >= LEAST_OF_PARABOLA; --size) {
      if (fitted(size, 2).second) return fitted(std::max(size / SAFE_SHARE, LEAST_OF_PARABOLA), 2).first;
    }
  }
  // Parabola through three pulses.
  const Pulse &first = pulses_[pulses_.size() - 3], &second = pulses_[pulses_.size() - 2];
  const double n0 = static_cast<double>(second.index - first.index);
  const double n1 = static_cast<double>(last.index - second.index);
  const double before = (second.time - first.time) / n0, after = (last.time - second.time) / n1;
  const double change = (after - before) * n1 / (n0 + n1), gain = n1 / (n0 + n1);
  // Of t_last, t_second, t_first in period = (1 + gain) after - gain before.
  const double noise = std::hypot((1.0 + gain) / n1, (1.0 + gain) / n1 + gain / n0, gain / n0);
  const double period = after + change;
  return {0.0, time_std / period, 1.0 / period, std::hypot(time_std * noise, change) / (period * period), 3};
}

PulseReading PulseTachometer::readingOf(const Fit& fit) const {
  const Pulse& last = pulses_.back();
  const double pitch = units::TWO_PI / parameters_.pulses_per_revolution;
  const double turned = static_cast<double>(last.index % parameters_.pulses_per_revolution) + fit.ahead;
  PulseReading reading;
  reading.angle = {last.time, wrapped(parameters_.angle + pitch * turned), pitch * fit.rate};
  reading.angle_std = pitch * fit.ahead_std;
  reading.speed_std = pitch * fit.rate_std;
  return reading;
}

std::optional<PulseReading> PulseTachometer::waitUntil(double time) {
  if (!silent_ || time < *silent_ - RESTART) silent_ = time;
  if (time - *silent_ <= parameters_.longest_period) return {};
  restart();
  const double slowest = units::TWO_PI / parameters_.pulses_per_revolution / parameters_.longest_period;
  if (controller_speed_ > slowest) {
    if (state_ != State::no_pulses)
      fault(formatted("no pulse for %.2f s, but the controller reports %.0f rpm", time - *silent_,
                      controller_speed_ * 60.0 / units::TWO_PI));
    state_ = State::no_pulses;
    return {};
  }
  state_ = State::at_rest;
  return PulseReading{{time, NOT_A_NUMBER, 0.0}, NOT_A_NUMBER, slowest};
}

std::vector<double> angleOfPulses(const std::vector<double>& time, const std::vector<double>& values,
                                  const PulseTachometerParameters& parameters, const std::string& where,
                                  std::vector<std::string>* notes) {
  if (time.size() < 2 || values.size() != time.size())
    throw Error(where + ": expected a value for each of at least two times");
  parameters.validate();
  PulseDetector detector(parameters);
  std::vector<double> pulses;
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (const auto pulse = detector.push(time[i], values[i])) pulses.push_back(*pulse);
  }
  if (pulses.size() < ALIKE_PERIODS + 1)
    throw Error(where + formatted(": %zu pulses through %g V, expected at least %zu", pulses.size(),
                                  parameters.threshold, ALIKE_PERIODS + 1));
  // The periods of a record are known: a pulse is double or missing as compared with their median.
  std::vector<double> periods;
  for (std::size_t i = 1; i < pulses.size(); ++i) periods.push_back(pulses[i] - pulses[i - 1]);
  std::nth_element(periods.begin(), periods.begin() + static_cast<std::ptrdiff_t>(periods.size() / 2),
                   periods.end());
  double period = periods[periods.size() / 2];
  std::vector<double> at{pulses[0]}, turned{0.0};
  std::size_t missing = 0, doubled = 0;
  for (std::size_t i = 1; i < pulses.size(); ++i) {
    const double count = (pulses[i] - at.back()) / period;
    const double whole = std::round(count);
    if (whole < 1.0 || (count < 1.0 - parameters.period_change)) {
      ++doubled;
      continue;
    }
    if (std::abs(count - whole) > parameters.period_change)
      throw Error(where + formatted(": irregular pulse at %.6f s: %.3f ms after the last, expected %.3f ms",
                                    pulses[i], 1e3 * (pulses[i] - at.back()), 1e3 * period));
    missing += static_cast<std::size_t>(whole) - 1;
    period = (pulses[i] - at.back()) / whole;
    at.push_back(pulses[i]);
    turned.push_back(turned.back() + whole);
  }
  if (notes && missing + doubled > 0)
    notes->push_back(where + formatted(": %zu pulses missing, %zu double", missing, doubled));
  if (at.size() < 2) throw Error(where + ": all pulses but one are double");
  const double pitch = units::TWO_PI / parameters.pulses_per_revolution;
  std::vector<double> angle;
  angle.reserve(time.size());
  std::size_t next = 1;
  for (const double t : time) {
    while (next + 1 < at.size() && t > at[next]) ++next;
    const double share = (t - at[next - 1]) / (at[next] - at[next - 1]);
    const double pulse = turned[next - 1] + share * (turned[next] - turned[next - 1]);
    angle.push_back(wrapped(parameters.angle + pitch * pulse));
  }
  return angle;
}

}  // namespace smartmill
