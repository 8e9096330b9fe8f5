#pragma once

namespace smartmill::plant {

/// q'' + 2 zeta w q' + w^2 q = w^2 p: at rest q = p. Exact at the steps for a piecewise linear p (recurrence
/// of Nigam and Jennings, 1969).
class Oscillator {
 public:
  /// @param frequency [Hz], undamped @param damping_ratio [1] 0..1 @param step [s]
  Oscillator(double frequency, double damping_ratio, double step);

  double value() const { return value_; }
  double rate() const { return rate_; }
  /// Value at the end of a step to p, without advancing the state.
  double valueIf(double p) const { return value_ * a_ + rate_ * b_ + p_ * c_ + p * d_; }
  double rateIf(double p) const { return value_ * e_ + rate_ * f_ + p_ * g_ + p * h_; }
  void step(double p);

 private:
  double a_, b_, c_, d_, e_, f_, g_, h_;
  double value_ = 0.0, rate_ = 0.0, p_ = 0.0;
};

}  // namespace smartmill::plant
