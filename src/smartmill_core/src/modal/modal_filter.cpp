#include "smartmill_core/modal/modal_filter.h"

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/modal/state_space.h"
#include "smartmill_core/units.h"

namespace smartmill {

ModalFilter::ModalFilter(const ModalModel& model, double sample_rate, Hold hold)
    : direct_(model.direct), sample_rate_(sample_rate) {
  if (!(sample_rate > 0.0)) {
    throw Error("modal filter: sample rate " + std::to_string(sample_rate) + " Hz is not positive");
  }
  for (const Mode& mode : model.modes) {
    if (!(mode.frequency > 0.0) || !(mode.damping_ratio > 0.0 && mode.damping_ratio < 1.0)) {
      throw Error("modal filter: mode of " + std::to_string(mode.frequency) + " Hz, damping ratio " +
                  std::to_string(mode.damping_ratio) + " (frequency > 0, 0 < damping ratio < 1)");
    }
    const double w = units::TWO_PI * mode.frequency;
    const double angle = w / sample_rate;
    // States: output, rate / w, input, increment of the input over the step. One exponential gives the
    // transition and both input terms, without the cancellation of the closed-form quotients at small angles.
    Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(4, 4);
    joint(0, 1) = angle;
    joint(1, 0) = -angle;
    joint(1, 1) = -2.0 * mode.damping_ratio * angle;
    joint(1, 2) = angle;
    joint(2, 3) = 1.0;
    const Eigen::MatrixXd e = linear::exponential(joint);
    Section section{e(0, 0),
                    e(0, 1) / w,
                    e(1, 0) * w,
                    e(1, 1),
                    e(0, 2),
                    e(1, 2) * w,
                    0.0,
                    0.0,
                    mode.gain,
                    0.0,
                    0.0,
                    w * w,
                    2.0 * mode.damping_ratio * w};
    if (hold == Hold::first_order) {
      section.c1 = e(0, 3);
      section.c2 = e(1, 3) * w;
      section.b1 -= section.c1;
      section.b2 -= section.c2;
    }
    sections_.push_back(section);
  }
}

double ModalFilter::jump(double before, double input) {
  const double output = step(before);
  last_input_ = input;
  return output + direct_ * (input - before);
}

double ModalFilter::peek(double input) const {
  double output = direct_ * input;
  for (const Section& s : sections_) {
    output += s.gain * (s.a11 * s.x + s.a12 * s.v + s.b1 * last_input_ + s.c1 * input);
  }
  return output;
}

double ModalFilter::peekRate(double input) const {
  double rate = direct_ * sample_rate_ * (input - last_input_);
  for (const Section& s : sections_) {
    rate += s.gain * (s.a21 * s.x + s.a22 * s.v + s.b2 * last_input_ + s.c2 * input);
  }
  return rate;
}

double ModalFilter::rateOfInput() const {
  double rate = direct_ * sample_rate_;
  for (const Section& s : sections_) rate += s.gain * s.c2;
  return rate;
}

void ModalFilter::reset(double constant_input) {
  for (Section& s : sections_) {
    s.x = constant_input;
    s.v = 0.0;
  }
  last_input_ = constant_input;
}

double ModalFilter::acceleration() const {
  double sum = 0.0;
  for (const Section& s : sections_) sum += s.gain * (s.stiffness * (last_input_ - s.x) - s.damping * s.v);
  return sum;
}

void ModalFilter::continueFrom(const ModalFilter& before) {
  if (before.sections_.size() != sections_.size())
    throw Error("modal filter: expected a filter with the same number of modes to continue from");
  for (std::size_t k = 0; k < sections_.size(); ++k) {
    sections_[k].x = before.sections_[k].x;
    sections_[k].v = before.sections_[k].v;
  }
  last_input_ = before.last_input_;
}

}  // namespace smartmill
