#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_core/modal/modal_model.h"

namespace smartmill {

/// Course of the input between samples.
enum class Hold { zero_order, first_order };

/// Response of a ModalModel to a sampled input, exact for inputs that are constant (zero order) or linear
/// (first order) between samples: closed matrix exponential of each 2x2 mode, started at rest. No allocation
/// in step().
class ModalFilter {
 public:
  /// @param sample_rate [Hz] > 0. @throws Error on a mode with frequency <= 0 or damping outside (0, 1).
  ModalFilter(const ModalModel& model, double sample_rate, Hold hold);

  /// Output [unit x unit of input] at this sample. First order: the input runs linearly from the last
  /// sample's to this one's. Zero order: the output at this sample knows the inputs of the samples before
  /// (the direct share also this one's).
  double step(double input) {
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

  /// step() with an input that came linearly to before and jumps now: output with the new input.
  double jump(double before, double input);

  /// What step() would give, without taking the step.
  double peek(double input) const;

  /// The rate of that output [unit/s x unit of input], and by how much a unit more of this input raises it.
  double peekRate(double input) const;
  double rateOfInput() const;

  /// At rest, or in the static state of a constant input.
  void reset(double constant_input = 0.0);

  /// Second derivative of the modes' output at the last step [unit/s2 x unit of input].
  double acceleration() const;

  /// Goes on from the state of a filter with as many modes in the same order (whose modes have moved since).
  void continueFrom(const ModalFilter& before);

 private:
  struct Section {
    double a11, a12, a21, a22;  // state transition: output [unit], its rate [unit/s]
    double b1, b2;              // share of the input before
    double c1, c2;              // share of this input (first order hold)
    double gain;
    double x, v;
    double stiffness, damping;  // x'' = stiffness (input - x) - damping x'
  };
  std::vector<Section> sections_;
  double direct_, sample_rate_;
  double last_input_ = 0.0;
};

}  // namespace smartmill
