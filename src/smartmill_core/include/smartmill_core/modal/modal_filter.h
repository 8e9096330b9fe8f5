#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "smartmill_core/modal/modal_model.h"

namespace smartmill {

/// Interpolation of the input between samples.
enum class Hold { zero_order, first_order };

/// Response of a ModalModel to a sampled input, exact for inputs that are constant (zero order) or linear
/// (first order) between samples: closed-form matrix exponential of each 2x2 mode, initially at rest. step()
/// does not allocate.
class ModalFilter {
 public:
  /// @param sample_rate [Hz] > 0. @throws Error on a mode with frequency <= 0 or damping outside (0, 1).
  ModalFilter(const ModalModel& model, double sample_rate, Hold hold);

  /// Output [unit x unit of input] at this sample. First order: the input is linear between the last sample
  /// and this one. Zero order: the output depends on the inputs of earlier samples (its direct share also on
  /// this one's).
  double step(double input) {
    if (input == 0.0 && last_input_ == 0.0) endDecay();
    double output = direct_ * input;
    for (Section& s : sections_) {
      const double x = s.a11 * s.x + s.a12 * s.v + s.b1 * last_input_ + s.c1 * input;
      s.v = s.a21 * s.x + s.a22 * s.v + s.b2 * last_input_ + s.c2 * input;
      s.x = x;
      output += s.gain * x;
    }
    last_input_ = input;
    return output;
  }

  /// step() with an input that runs linearly to `before` and then jumps to `input`: output with the new
  /// input.
  double jump(double before, double input);

  /// The output of step(), without changing the state.
  double peek(double input) const;

  /// Rate of that output [unit/s x unit of input].
  double peekRate(double input) const;
  /// Increase of that rate per unit of this input [unit/s].
  double rateOfInput() const;

  /// Resets to rest, or to the static state of a constant input.
  void reset(double constant_input = 0.0);

  /// Second derivative of the modes' output at the last step [unit/s2 x unit of input].
  double acceleration() const;

  /// Takes over the state of a filter with the same number of modes in the same order (whose parameters may
  /// differ).
  void continueFrom(const ModalFilter& before);

 private:
  struct Section {
    double a11, a12, a21, a22;  // state transition: output [unit], its rate [unit/s]
    double b1, b2;              // of the previous input
    double c1, c2;              // of this input (first-order hold)
    double gain;
    double x, v;
    double stiffness, damping;  // x'' = stiffness (input - x) - damping x'
  };
  /// A free vibration ends at 1e-200 of the unit of input: it would decay to denormal numbers, with which a
  /// processor computes a hundred times more slowly.
  void endDecay() {
    for (Section& s : sections_) {
      if (std::abs(s.x) + std::abs(s.v) < 1e-200) s.x = s.v = 0.0;
    }
  }

  std::vector<Section> sections_;
  double direct_, sample_rate_;
  double last_input_ = 0.0;
};

}  // namespace smartmill
