#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <deque>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "plant/hidden.h"
#include "plant/machine.h"
#include "plant/oscillator.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::plant {

using Channels = std::array<double, 4>;  // fx, fy, fz [N], load meter [V]
constexpr std::size_t LOAD = 3;

inline std::size_t channelNumber(const std::string& name) {
  const std::vector<std::string> names{"fx", "fy", "fz", "load_meter"};
  const auto at = std::find(names.begin(), names.end(), name);
  if (at == names.end()) throw Error("plant: no channel '" + name + "'");
  return static_cast<std::size_t>(at - names.begin());
}

/// Force sensor: from applied forces to channels.
class Sensor {
 public:
  Sensor(const Plant& plant, const Hidden& hidden, double rpm, double step) : direct_(plant.sensor_direct) {
    std::vector<SensorMode> modes = plant.sensor;
    for (const EffectEntry* e : hidden.all("extra_mode")) {
      const std::size_t a = e->words.at("axis") == "x" ? 0 : e->words.at("axis") == "y" ? 1 : 2;
      SensorMode extra;
      extra.frequency = e->numbers.at("frequency_hz");
      extra.damping_ratio = e->numbers.at("damping_ratio");
      extra.input[a] = e->numbers.at("gain");
      extra.output[a] = 1.0;
      modes.push_back(extra);
      direct_[a] -= extra.input[a];
    }
    const double loaded = 1.0 / std::sqrt(1.0 + hidden("mass_loading", "mass_ratio"));
    const double softened = 1.0 - hidden("speed_dependent_mode", "softening_per_krpm") * rpm / 1000.0;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto main = std::find_if(modes.begin(), modes.end(),
                                     [&](const SensorMode& m) { return m.input[a] * m.output[a] > 0.3; });
      if (main != modes.end()) main->frequency *= loaded * softened;
    }
    for (const SensorMode& m : modes) modes_.emplace_back(Oscillator(m.frequency, m.damping_ratio, step), m);
  }

  void step(const std::array<double, 3>& force) {
    force_ = force;
    for (auto& [oscillator, mode] : modes_)
      oscillator.step(mode.input[0] * force[0] + mode.input[1] * force[1] + mode.input[2] * force[2]);
  }
  std::array<double, 3> output() const {
    std::array<double, 3> sum{};
    for (std::size_t a = 0; a < 3; ++a) {
      sum[a] = direct_[a] * force_[a];
      for (const auto& [oscillator, mode] : modes_) sum[a] += mode.output[a] * oscillator.value();
    }
    return sum;
  }

 private:
  std::array<double, 3> direct_, force_{};
  std::vector<std::pair<Oscillator, SensorMode>> modes_;
};

/// Spindle's friction and the load meter [V].
class Drive {
 public:
  Drive(const Plant& plant, const Hidden& hidden, const CampaignTest& test, double step)
      : spindle_(*plant.spindle), speed_(test.spindle_speed) {
    friction_ = spindle_.viscous * speed_ + spindle_.coulomb;
    if (hidden.has("stribeck_friction"))
      friction_ +=
          hidden("stribeck_friction", "breakaway_nm") *
          std::exp(-std::pow(units::rpmFromRadPerSec(speed_) / hidden("stribeck_friction", "speed_rpm"), 2));
    if (hidden.has("friction_warmup"))
      friction_ *=
          1.0 + hidden("friction_warmup", "cold_ratio") *
                    std::exp(-test.start_time.value_or(0.0) / hidden("friction_warmup", "time_constant_s"));
    const double bandwidth = hidden.has("load_meter_lag") ? hidden("load_meter_lag", "bandwidth_hz")
                                                          : spindle_.load_meter_bandwidth;
    keep_ = std::exp(-units::TWO_PI * bandwidth * step);
    value_ = steady(0.0);
  }
  void step(double torque) { value_ = keep_ * value_ + (1.0 - keep_) * steady(torque); }
  double value() const { return value_; }

 private:
  double steady(double torque) const { return spindle_.load_meter_gain * (torque + friction_) * speed_; }
  Spindle spindle_;
  double speed_, friction_ = 0.0, keep_ = 0.0, value_ = 0.0;
};

/// Forces on the sensor other than cutting forces.
class Disturbance {
 public:
  Disturbance(const Hidden& hidden, double speed, std::mt19937_64& random)
      : unbalance_(1e-6 * hidden("unbalance", "mass_eccentricity_g_mm") * speed * speed),
        unbalance_angle_(units::radFromDeg(hidden("unbalance", "angle_deg"))) {
    for (const EffectEntry* e : hidden.all("axis_inertia"))
      moved_mass_[channelNumber("f" + e->words.at("axis"))] += e->numbers.at("mass_kg");
    if (speed == 0.0) return;
    for (const EffectEntry* e : hidden.all("spindle_order")) {
      Order order{e->numbers.at("order"), {}, {}};
      const std::array<std::string, 3> axes{"x", "y", "z"};
      for (std::size_t a = 0; a < 3; ++a) {
        order.size[a] = e->numbers.at(axes[a] + "_n");
        order.phase[a] = units::radFromDeg(e->numbers.at(axes[a] + "_deg"));
      }
      orders_.push_back(order);
    }
    // A bearing's cage slips: its phase has no relation to the angle of the spindle.
    for (const EffectEntry* e : hidden.all("bearing_tone")) {
      const double phase = std::uniform_real_distribution<double>(0, units::TWO_PI)(random);
      const auto& n = e->numbers;
      orders_.push_back({n.at("order"), {n.at("x_n"), n.at("y_n"), n.at("z_n")}, {phase, phase, phase}});
    }
  }
  /// [N] @param angle [rad] of the spindle @param axes [m/s2] acceleration of the machine's axes
  std::array<double, 3> force(double angle, const std::array<double, 3>& axes) const {
    const double at = angle + unbalance_angle_;
    std::array<double, 3> force{unbalance_ * std::sin(at), unbalance_ * std::cos(at), 0.0};
    for (std::size_t a = 0; a < 3; ++a) force[a] -= moved_mass_[a] * axes[a];
    for (const Order& o : orders_) {
      for (std::size_t a = 0; a < 3; ++a) force[a] += o.size[a] * std::sin(o.order * angle + o.phase[a]);
    }
    return force;
  }

 private:
  struct Order {
    double order = 0.0;
    std::array<double, 3> size{}, phase{};  // [N], [rad]
  };
  double unbalance_, unbalance_angle_;  // [N], [rad]
  std::array<double, 3> moved_mass_{};  // [kg] with the sensor, by axis
  std::vector<Order> orders_;
};

/// Amplifiers, cables and the recorder: from the sensor to the file.
class Chain {
 public:
  /// @param start [s] of the record since the machine was cold
  Chain(const Plant& plant, const Hidden& hidden, double start, double speed, double step,
        std::mt19937_64& random)
      : plant_(plant),
        hidden_(hidden),
        start_(start),
        speed_(speed),
        step_(step),
        hum_phase_(std::uniform_real_distribution<double>(0, units::TWO_PI)(random)),
        own_phase_(std::uniform_real_distribution<double>(0, units::TWO_PI)(random)) {
    if (isOutside(plant, "zero_of_record")) own_zero_ = std::normal_distribution<double>()(random);
    for (const EffectEntry* e : hidden.all("channel_delay")) {
      delay_[channelNumber(e->words.at("channel"))] += 1e-6 * e->numbers.at("delay_us");
      delayed_ = true;
    }
    longest_ = static_cast<std::size_t>(*std::max_element(delay_.begin(), delay_.end()) / step_) + 3;
    const char axes[] = {'x', 'y', 'z'};
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b)
        cross_talk_[a][b] = a == b ? 1.0 : hidden("cross_talk", {axes[a], axes[b]});
    }
    for (const EffectEntry* e : hidden.all("gain_error"))
      gain_[channelNumber(e->words.at("channel"))] *= e->numbers.at("gain");
  }

  /// Called every step: crosstalk and gains, before the delays.
  void feed(const Channels& c) {
    Channels mixed = c;
    for (std::size_t a = 0; a < 3; ++a)
      mixed[a] = cross_talk_[a][0] * c[0] + cross_talk_[a][1] * c[1] + cross_talk_[a][2] * c[2];
    for (std::size_t k = 0; k < mixed.size(); ++k) mixed[k] *= gain_[k];
    late_.push_back(mixed);
    while (late_.size() > longest_) late_.pop_front();
  }

  /// The recorded values of this instant, without noise. @param angle [rad] of the spindle
  Channels output(double time, double angle) const {
    Channels c = late_.back();
    if (delayed_) {
      for (std::size_t k = 0; k < c.size(); ++k) c[k] = lateValue(k);
    }
    c[0] += hidden_("charge_drift", "rate_n_per_min") / 60.0 * time;
    c[1] += hidden_("charge_drift", "y_ratio") * hidden_("charge_drift", "rate_n_per_min") / 60.0 * time;
    const double hum = hidden_("mains_hum", "amplitude_n") *
                       std::sin(units::TWO_PI * hidden_("mains_hum", "frequency_hz") * time + hum_phase_);
    c[0] += hum;
    c[1] += hidden_("mains_hum", "y_ratio") * hum;
    c[0] += hidden_("zero_offset", "x_n");
    c[1] += hidden_("zero_offset", "y_n");
    c[2] += hidden_("zero_offset", "z_n");
    if (plant_.outside) addOutside(*plant_.outside, time, angle, c);
    if (hidden_.has("saturation")) {
      const double limit = hidden_("saturation", "limit_n");
      for (std::size_t a = 0; a < 3; ++a) c[a] = std::clamp(c[a], -limit, limit);
    }
    return c;
  }

 private:
  double lateValue(std::size_t k) const {
    const double back = delay_[k] / step_;
    const std::size_t whole = static_cast<std::size_t>(back);
    const double part = back - static_cast<double>(whole);
    const auto at = [&](std::size_t n) { return late_[late_.size() - 1 - std::min(n, late_.size() - 1)][k]; };
    return (1.0 - part) * at(whole) + part * at(whole + 1);
  }

  void addOutside(const Outside& o, double time, double angle, Channels& c) const {
    if (o.channel.empty()) return;
    double& value = c[channelNumber(o.channel)];
    if (o.kind == "tone") value += o.size * std::sin(units::TWO_PI * o.place * time + own_phase_);
    if (o.kind == "half_order" && speed_ > 0.0) value += o.size * std::sin(0.5 * angle + own_phase_);
    if (o.kind == "settling") value += o.size * std::exp(-time / o.place);
    if (o.kind == "zero_drift") value += o.size / 60.0 * (start_ + time);
    if (o.kind == "zero_approach") value += o.size * (1.0 - std::exp(-(start_ + time) / o.place));
    if (o.kind == "zero_step" && start_ + time > o.place) value += o.size;
    if (o.kind == "zero_of_record") value += o.size * own_zero_;
    if (o.kind == "curve") value *= 1.0 + o.size * std::abs(value) / 1000.0;
    if (o.kind == "bursts") {
      const double since = std::fmod(time + o.place * own_phase_ / units::TWO_PI, o.place);
      value += o.size * std::exp(-since / 2e-3) * std::sin(units::TWO_PI * 1700.0 * since);
    }
  }

  const Plant& plant_;
  const Hidden& hidden_;
  double start_, speed_, step_, hum_phase_, own_phase_, own_zero_ = 0.0;
  std::array<double, 4> delay_{};
  bool delayed_ = false;
  std::size_t longest_ = 0;  // delay of the slowest channel [steps]
  std::array<std::array<double, 3>, 3> cross_talk_{};
  Channels gain_{1.0, 1.0, 1.0, 1.0};
  std::deque<Channels> late_;
};

/// White noise with a share of first-order noise below 300 Hz.
class Noise {
 public:
  Noise(double rms, double colour, double sample_rate)
      : white_(rms * std::sqrt(1.0 - colour)),
        keep_(std::exp(-units::TWO_PI * 300.0 / sample_rate)),
        drive_(rms * std::sqrt(colour * (1.0 - keep_ * keep_))) {}
  double operator()(std::mt19937_64& random) {
    low_ = keep_ * low_ + drive_ * normal_(random);
    return low_ + white_ * normal_(random);
  }

 private:
  double white_, keep_, drive_, low_ = 0.0;
  std::normal_distribution<double> normal_;
};

}  // namespace smartmill::plant
