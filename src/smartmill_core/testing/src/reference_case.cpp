#include "smartmill_core/testing/reference_case.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr int FINER = 8;
/// Step of the change of the sensor's parameters.
constexpr double DRIFT_STEP = 1e-3;  // [s]

ModalModel between(const ModalModel& a, const ModalModel& b, double share) {
  ModalModel model = a;
  const auto mix = [share](double from, double to) { return from + share * (to - from); };
  for (std::size_t k = 0; k < a.modes.size(); ++k) {
    model.modes[k].frequency = mix(a.modes[k].frequency, b.modes[k].frequency);
    model.modes[k].damping_ratio = mix(a.modes[k].damping_ratio, b.modes[k].damping_ratio);
    model.modes[k].gain = mix(a.modes[k].gain, b.modes[k].gain);
  }
  model.direct = mix(a.direct, b.direct);
  return model;
}

/// A sensor with changing parameters; displacement and velocity of each mode are continuous.
class MovingSensor {
 public:
  explicit MovingSensor(double rate) : dt_(1.0 / rate) {}
  void set(const ModalModel& model) {
    model_ = model;
    sections_.resize(model.modes.size());
    for (std::size_t k = 0; k < sections_.size(); ++k) {
      const double w = units::TWO_PI * model.modes[k].frequency, z = model.modes[k].damping_ratio;
      const double wd = w * std::sqrt(1.0 - z * z), e = std::exp(-z * w * dt_);
      const double c = std::cos(wd * dt_), s = std::sin(wd * dt_) / wd;
      Section& n = sections_[k];
      n.a11 = e * (c + z * w * s), n.a12 = e * s, n.a21 = -e * w * w * s, n.a22 = e * (c - z * w * s);
      n.gain = model.modes[k].gain;
      n.w = w, n.z = z;
    }
  }
  // Force linear over the step: the particular solution of x'' + 2 z w x' + w^2 x = w^2 (f0 + slope t) is
  // f0 - 2 z slope / w + slope t.
  double step(double force) {
    const double slope = (force - last_) / dt_;
    double out = model_.direct * force;
    for (Section& n : sections_) {
      const double p0 = last_ - 2.0 * n.z * slope / n.w;
      const double x = n.x - p0, v = n.v - slope;
      n.x = n.a11 * x + n.a12 * v + p0 + slope * dt_;
      n.v = n.a21 * x + n.a22 * v + slope;
      out += n.gain * n.x;
    }
    last_ = force;
    return out;
  }

 private:
  struct Section {
    double a11, a12, a21, a22, gain, w, z, x = 0.0, v = 0.0;
  };
  double dt_;
  ModalModel model_;
  std::vector<Section> sections_;
  double last_ = 0.0;
};

}  // namespace

ToolGeometry ReferenceCase::tool() {
  return {4, 16e-3, units::radFromDeg(30.0), {}};
}

Engagement ReferenceCase::slot() {
  return {0.0, units::PI, 2e-3, 6e-5};
}

ModalModel ReferenceCase::exactSensor() {
  ModalModel model;
  model.modes = {{1450.0, 0.025, 0.7}, {2300.0, 0.03, 0.2}, {3600.0, 0.02, 0.1}};
  return model;
}

double ReferenceCase::speedAt(double time) const {
  const double cutting = std::max(0.0, time - engage_time);
  const double load = speed_drop * (1.0 - std::exp(-cutting / drop_time));
  if (speed_ripple == 0.0) return spindle_speed * (1.0 - load);
  const double ripple = std::sqrt(2.0) * speed_ripple * std::sin(units::TWO_PI * ripple_frequency * time);
  return spindle_speed * (1.0 - load + ripple);
}

double ReferenceCase::angleAt(double time) const {
  const double cutting = std::max(0.0, time - engage_time);
  const double load = speed_drop * (cutting - drop_time * (1.0 - std::exp(-cutting / drop_time)));
  if (speed_ripple == 0.0) return spindle_speed * (time - load);
  const double w = units::TWO_PI * ripple_frequency;  // [rad/s]
  const double ripple = std::sqrt(2.0) * speed_ripple * (1.0 - std::cos(w * time)) / w;
  return spindle_speed * (time - load + ripple);
}

ReferenceRecord simulate(const ReferenceCase& reference) {
  CuttingLaw law;
  law.coefficients = {800e6, 250e6, 0.0, 20e3, 20e3, 0.0};
  const ToolGeometry tool = ReferenceCase::tool();
  RigidCut cut(tool, law, ReferenceCase::slot(), runoutRadii(tool, 8e-6, units::radFromDeg(31.0)));
  const double fine = FINER * reference.sample_rate;
  std::array<MovingSensor, 2> sensor{MovingSensor(fine), MovingSensor(fine)};
  for (MovingSensor& axis : sensor) axis.set(reference.sensor);
  std::mt19937 random(reference.seed);
  std::normal_distribution<double> noise(0.0, reference.noise_rms);
  ReferenceRecord record;
  const auto samples = static_cast<std::size_t>(std::lround(reference.duration * reference.sample_rate));
  double next_change = reference.drift_from;
  for (std::size_t i = 0; i < samples; ++i) {
    const double time = static_cast<double>(i) / reference.sample_rate;
    if (time >= next_change) {
      const double share = (time - reference.drift_from) / (reference.drift_to - reference.drift_from);
      for (MovingSensor& axis : sensor)
        axis.set(between(reference.sensor, reference.later, std::clamp(share, 0.0, 1.0)));
      next_change = share >= 1.0 ? 1e9 : time + DRIFT_STEP;
    }
    std::array<double, 2> applied{}, measured{};
    for (int step = FINER - 1; step >= 0; --step) {
      const double t = time - step / fine;
      applied = {};
      if (t >= reference.engage_time) {
        const CuttingForce force = cut.at(reference.angleAt(t));
        applied = {force.fx, force.fy};
      }
      for (std::size_t axis = 0; axis < 2; ++axis) measured[axis] = sensor[axis].step(applied[axis]);
    }
    record.time.push_back(time);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      record.truth[axis].push_back(applied[axis]);
      record.measured[axis].push_back(measured[axis] + noise(random));
    }
  }
  return record;
}

ReferenceTaps simulateTaps(const ReferenceCase& reference, int taps) {
  constexpr double PEAK = 500.0, CONTACT = 0.2e-3, BEFORE = 0.01, LENGTH = 0.2, HAMMER_NOISE = 0.1;
  const double fine = FINER * reference.sample_rate;
  std::mt19937 random(reference.seed + 7919);
  std::normal_distribution<double> noise(0.0, 1.0);
  ReferenceTaps result;
  const auto samples = static_cast<std::size_t>(LENGTH * reference.sample_rate);
  for (int tap = 0; tap < taps; ++tap) {
    MovingSensor sensor(fine);
    sensor.set(reference.sensor);
    std::vector<double> hammer, response;
    // The hit is at varying times between two samples.
    const double start = BEFORE + static_cast<double>(tap) / taps / reference.sample_rate;
    for (std::size_t i = 0; i < samples; ++i) {
      double force = 0.0, out = 0.0;
      for (int step = FINER - 1; step >= 0; --step) {
        const double into = (static_cast<double>(i) / reference.sample_rate - step / fine - start) / CONTACT;
        force = into > 0.0 && into < 1.0 ? PEAK * std::pow(std::sin(units::PI * into), 2) : 0.0;
        out = sensor.step(force);
      }
      hammer.push_back(force + HAMMER_NOISE * noise(random));
      response.push_back(out + reference.noise_rms * noise(random));
    }
    result.hammer.push_back(std::move(hammer));
    result.response.push_back(std::move(response));
  }
  return result;
}

double bandError(const std::vector<double>& estimate, const std::vector<double>& truth, double sample_rate,
                 std::size_t from, std::size_t to, double band) {
  if (to <= from || to > estimate.size() || to > truth.size()) throw Error("band error: no such samples");
  const std::vector<double> window = hannWindow(to - from);
  std::vector<double> difference, applied;
  for (std::size_t i = from; i < to; ++i) {
    difference.push_back(window[i - from] * (estimate[i] - truth[i]));
    applied.push_back(window[i - from] * truth[i]);
  }
  const auto wrong = fourier(difference), all = fourier(applied);
  const std::vector<double> frequency = fourierFrequencies(to - from, sample_rate);
  double error = 0.0, norm = 0.0;
  for (std::size_t k = 0; k < all.size() && frequency[k] <= band; ++k) {
    error += std::norm(wrong[k]);
    norm += std::norm(all[k]);
  }
  return std::sqrt(error / norm);
}

}  // namespace smartmill
