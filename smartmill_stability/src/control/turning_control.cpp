#include "smartmill_stability/control/turning_control.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {

std::complex<double> SecondOrder::response(double w) const {
  return gain * frequency * frequency /
         std::complex<double>(frequency * frequency - w * w, 2.0 * damping_ratio * frequency * w);
}

ModalModel SecondOrder::modal() const {
  return {{{frequency / units::TWO_PI, damping_ratio, gain}}, 0.0};
}

double residualMargin(const SecondOrder& machine, const SecondOrder& controller) {
  double least = 0.0;
  const auto include = [&](double w) {
    least = std::min(least, (machine.response(w) - controller.response(w)).real());
  };
  for (const SecondOrder* model : {&machine, &controller}) {
    if (model->frequency <= 0.0) continue;
    // Dense around the resonance, coarse elsewhere.
    constexpr int DENSE = 200, COARSE = 100;
    for (int i = -DENSE; i <= DENSE; ++i)
      include(std::abs(model->frequency *
                       (1.0 + 20.0 * model->damping_ratio * std::pow(static_cast<double>(i) / DENSE, 3))));
    for (int i = 0; i <= COARSE; ++i) include(3.0 * model->frequency * i / COARSE);
  }
  return least;
}

double worstMargin(const SecondOrder& machine, const SecondOrder& controller) {
  double worst = residualMargin(machine, controller);
  // Principal axes of the relative covariance, whose entries are of comparable size.
  const Eigen::Vector3d mean(machine.gain, machine.frequency, machine.damping_ratio);
  if (mean.minCoeff() <= 0.0) return worst;
  const Eigen::Matrix3d relative =
      mean.cwiseInverse().asDiagonal() * machine.covariance * mean.cwiseInverse().asDiagonal();
  const linear::SymmetricEigensystem axes = linear::symmetricEigensystem(Eigen::MatrixXd(relative));
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d off = 2.0 * std::sqrt(std::max(0.0, axes.values[k])) * axes.vectors.col(k);
    for (const double sign : {-1.0, 1.0}) {
      SecondOrder other = machine;
      other.gain *= std::max(0.05, 1.0 + sign * off[0]);
      other.frequency *= std::max(0.05, 1.0 + sign * off[1]);
      other.damping_ratio *= std::max(0.05, 1.0 + sign * off[2]);
      worst = std::min(worst, residualMargin(other, controller));
    }
  }
  return worst;
}

void ControllerParameters::validate() const {
  checkBounds(*this);
  const double ratio = rate / estimator.sample_rate;
  require(ratio >= 1.0 && std::abs(ratio - std::round(ratio)) < 1e-9, "rate over estimator_rate", ratio,
          "a positive integer");
  require("period [s]", period, Range::above(2.0 / rate));
  require(std::abs(lead * rate - std::round(lead * rate)) < 1e-6, "lead in samples", lead * rate,
          "an integer");
}

AdaptiveChatterController::AdaptiveChatterController(const ControllerParameters& parameters)
    : parameters_(parameters) {
  parameters_.validate();
}

double AdaptiveChatterController::pastSurface() const {
  // surface_[0] belongs to the current sample.
  const double back = parameters_.period * parameters_.rate;
  const auto i = static_cast<std::size_t>(back);
  if (i + 1 >= surface_.size()) return 0.0;  // first revolution
  const double share = back - static_cast<double>(i);
  return surface_[i] + share * (surface_[i + 1] - surface_[i]);
}

double AdaptiveChatterController::step(double deflection, double tool) {
  surface_.push_front(deflection - tool);
  const auto longest = static_cast<std::size_t>(parameters_.period * parameters_.rate) + 3;
  if (surface_.size() > longest) surface_.pop_back();
  const double old = parameters_.chip + parameters_.overlap * pastSurface();
  double chip = old - surface_.front();
  if (parameters_.leaves_cut && chip < 0.0) {
    surface_.front() = old;  // the surface remains, one feed further away
    chip = 0.0;
  }
  chips_.push_front(chip);
  // Memory of a lightly damped machine, to initialise a new filter.
  constexpr double MEMORY = 1.0;  // [s]
  if (chips_.size() > static_cast<std::size_t>(MEMORY * parameters_.rate)) chips_.pop_back();

  const int decimation = static_cast<int>(std::lround(parameters_.rate / parameters_.estimator.sample_rate));
  if (phase_ == 0) {
    segment_chip_.push_back(chip);
    segment_deflection_.push_back(deflection);
  }
  phase_ = (phase_ + 1) % decimation;
  if (filter_) filter_->step(chip);
  if (phase_ == 0 && static_cast<int>(segment_chip_.size()) == parameters_.estimator.segment) {
    updateEstimate();
    segment_chip_.clear();
    segment_deflection_.clear();
  }
  // The command acts until the next sample: response of the machine there, with extrapolated chip thickness.
  double command = 0.0;
  if (filter_) {
    const bool immediate = parameters_.lead == 0.0 && parameters_.actuator_delay == 0.0;
    command = immediate ? filter_->peek(chips_.size() > 1 ? 2.0 * chips_[0] - chips_[1] : chip) : predicted();
  }
  issued_.push_front(command);
  const double latency = (parameters_.lead + parameters_.actuator_delay) * parameters_.rate;  // samples
  if (issued_.size() > static_cast<std::size_t>(latency) + 4) issued_.pop_back();
  return command;
}

// [m] Tool displacement by the pending commands, `after` samples after the current one.
double AdaptiveChatterController::issued(double after) const {
  // issued_[0] acts from `lead` after the last sample, through the delay of the actuator.
  const double age = (parameters_.lead + parameters_.actuator_delay) * parameters_.rate - after;
  if (issued_.empty()) return 0.0;
  if (age <= 0.0) return issued_.front();
  const auto i = static_cast<std::size_t>(age);
  if (i + 1 >= issued_.size()) return issued_.back();
  const double share = age - static_cast<double>(i);
  return issued_[i] + share * (issued_[i + 1] - issued_[i]);
}

// [m] Response of the machine at the time at which this command acts, predicted by simulating the cut under
// the pending commands.
double AdaptiveChatterController::predicted() {
  ModalFilter ahead = *filter_;
  const double scale = estimate_.gain / active_.gain, back = parameters_.period * parameters_.rate;
  const double horizon = 1.0 + (parameters_.lead + parameters_.actuator_delay) * parameters_.rate;  // samples
  const auto steps = static_cast<int>(std::ceil(horizon - 1e-9));
  double chip = chips_[0], before = 0.0, response = 0.0;
  future_surface_.clear();
  for (int k = 1; k <= steps; ++k) {
    const double tool = issued(k), age = back - k;
    double past = 0.0;
    if (age >= 0.0) {
      const auto i = static_cast<std::size_t>(age);
      if (i + 1 < surface_.size()) {
        past = surface_[i] + (age - static_cast<double>(i)) * (surface_[i + 1] - surface_[i]);
      }
    } else {
      past = future_surface_[std::min(future_surface_.size() - 1, static_cast<std::size_t>(-age))];
    }
    // The chip thickness of this sample affects the deflection of this sample: solved by iteration.
    const double old = parameters_.chip + parameters_.overlap * past;
    const auto chipAt = [&](double deflection) {
      const double free = old - (deflection - tool);
      return parameters_.leaves_cut ? std::max(0.0, free) : free;
    };
    for (int iteration = 0; iteration < 3; ++iteration) chip = chipAt(scale * ahead.peek(chip));
    before = response;
    response = ahead.step(chip);
    future_surface_.push_back(parameters_.leaves_cut && chip == 0.0 ? old : scale * response - tool);
  }
  return steps > 1 ? response + (steps - horizon) * (before - response) : response;
}

void AdaptiveChatterController::updateEstimate() {
  const SegmentEstimate found = estimateSegment(segment_chip_, segment_deflection_, parameters_.estimator,
                                                estimate_.gain > 0.0 ? &estimate_ : nullptr);
  segments_.push_back(found);
  if (found.informed) {
    if (estimate_.gain == 0.0) {
      estimate_ = found.model;
    } else {
      // Combination of prior and new estimate by their covariances, with the drift as process noise.
      Eigen::Vector3d old(estimate_.gain, estimate_.frequency, estimate_.damping_ratio);
      const Eigen::Vector3d fresh(found.model.gain, found.model.frequency, found.model.damping_ratio);
      Eigen::Matrix3d covariance = estimate_.covariance;
      covariance.diagonal() +=
          (parameters_.drift * Eigen::Vector3d(old[0], 0.1 * old[1], old[2])).cwiseAbs2();
      const Eigen::Matrix3d weight = covariance * (covariance + found.model.covariance).inverse();
      old += weight * (fresh - old);
      estimate_.gain = old[0];
      estimate_.frequency = old[1];
      estimate_.damping_ratio = std::clamp(old[2], 1e-4, 0.9);
      estimate_.covariance = (Eigen::Matrix3d::Identity() - weight) * covariance;
    }
  }
  estimates_.push_back(estimate_);
  if (estimate_.gain <= 0.0 || !found.informed) return;
  // Stability guard (Kim eq. 10): a new controller requires a larger margin than the active one.
  SecondOrder best = active_;
  double margin = active_.gain > 0.0 ? worstMargin(estimate_, active_) : -1e300;
  SecondOrder candidate = estimate_;
  for (const double share : {1.0, 0.9, 0.8, 0.7}) {
    candidate.gain = share * estimate_.gain;
    const double m = worstMargin(estimate_, candidate);
    if (m > margin) {
      margin = m;
      best = candidate;
    }
  }
  if (margin >= parameters_.margin || margin > worstMargin(estimate_, SecondOrder())) activate(best);
}

void AdaptiveChatterController::activate(const SecondOrder& model) {
  active_ = model;
  filter_ = std::make_unique<ModalFilter>(model.modal(), parameters_.rate, Hold::first_order);
  // Continues the current motion of the machine.
  filter_->reset(parameters_.chip);
  for (auto chip = chips_.rbegin(); chip != chips_.rend(); ++chip) filter_->step(*chip);
}

AccelerationIntegrator::AccelerationIntegrator(double corner, double rate)
    // 1 / (s^2 + sqrt(2) w s + w^2): 1 / s^2 above the corner.
    : filter_(ModalModel{{{corner, 0.5 * std::sqrt(2.0), 1.0 / std::pow(units::TWO_PI * corner, 2)}}, 0.0},
              rate, Hold::first_order) {
}

double AccelerationIntegrator::step(double acceleration) {
  return filter_.step(acceleration);
}

}  // namespace smartmill::stability
