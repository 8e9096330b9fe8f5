#include "smartmill_sim/world/spindle_sensor.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr double REFERENCE_SPEED = 1000.0;  // [rad/s] reference of speed-dependent terms

ModalModel modesOf(const std::vector<double>& frequency, const std::vector<double>& damping,
                   const std::vector<double>& share, double ratio) {
  ModalModel model;
  model.direct = 1.0;
  for (std::size_t k = 0; k < frequency.size(); ++k) {
    Mode mode;
    mode.frequency = ratio * frequency[k];
    mode.damping_ratio = damping[k];
    mode.gain = share[k];
    model.direct -= share[k];
    model.modes.push_back(mode);
  }
  return model;
}

void checkModes(const char* axis, const std::vector<double>& frequency, const std::vector<double>& damping,
                const std::vector<double>& share) {
  if (damping.size() == frequency.size() && share.size() == frequency.size()) return;
  throw Error(std::string(axis) + "_damping, " + axis + "_share: " + std::to_string(damping.size()) + ", " +
              std::to_string(share.size()) + " values, expected " + std::to_string(frequency.size()) +
              " as " + axis + "_frequency");
}

}  // namespace

void SpindleSensorTraits::declare(ParameterTable& table) {
  const Range any{}, share = Range::closed(-2.0, 2.0), hertz = Range::closed(10.0, 10000.0);
  const Range ratio = Range::open(0.0, 0.5), signal = Range::closed(0.0, 1000.0);
  table.section("Six force sensors in the spindle flange, daq/spindle_force (x1 x2 y1 y2 z1 z2).");
  table.flag("present", present, "whether the spindle has them");
  table.number("length", length, "m", Range::closed(0.02, 0.5), "length of tool and holder");
  table.list("reach", reach, "m", Range::closed(0.0, 1.0),
             "effective distance of the ring from the holder's face, for the pairs x, y, z");
  table.list("bending", bending, "1/m", Range::closed(0.0, 10.0),
             "force on each sensor of a pair over the bending moment");
  table.list("pair_angle", pair_angle, "rad", any,
             "angles of the pairs from +y towards +x; pair y: that of sensor y2");
  table.list("mismatch", mismatch, "1", Range::closed(-0.5, 0.5),
             "relative excess of the sensitivity of a pair's first sensor over the mean; the second has the "
             "opposite sign");
  table.number("axial", axial, "1", Range::closed(0.0, 1.0), "force on each sensor over the force along z");
  table.list("preload", preload, "N", Range::positive(), "compression at rest of the sensors of each pair");
  table.number("range_limit", range_limit, "N", Range::positive(), "largest compression that is measured");
  const auto modes = [&](const std::string& axis, std::vector<double>& f, std::vector<double>& d,
                         std::vector<double>& s) {
    table.list(axis + "_frequency", f, "Hz", hertz,
               "natural frequencies of spindle, holder and tool, one per mode");
    table.list(axis + "_damping", d, "1", ratio, "damping ratio, one per mode");
    table.list(axis + "_share", s, "1", share,
               "share of the static force, one per mode; the rest is transmitted directly");
  };
  modes("x", x_frequency, x_damping, x_share);
  modes("y", y_frequency, y_damping, y_share);
  modes("z", z_frequency, z_damping, z_share);
  table.number("reference_length", reference_length, "m", Range::closed(0.02, 0.5),
               "length of tool and holder at these frequencies");
  table.number("length_exponent", length_exponent, "1", Range::closed(0.0, 3.0),
               "frequencies are proportional to (reference_length / length)^exponent");
  table.number("plane_turn", plane_turn, "rad", Range::closed(-1.0, 1.0),
               "angle of the spindle's principal planes from x, y");
  table.number("unbalance", unbalance, "kg m", Range::closed(0.0, 0.01),
               "unbalance of spindle, holder and tool");
  table.number("unbalance_angle", unbalance_angle, "rad", any, "angle of the unbalance from tooth 1");
  table.number("zero", zero, "N", signal, "standard deviation of the sensors' initial offset");
  table.number("drift", drift, "N/s", Range::closed(0.0, 10.0), "standard deviation of the sensors' drift");
  table.number("thermal", thermal, "N", signal, "final thermal drift of each sensor at 1000 rad/s");
  table.number("thermal_time", thermal_time, "s", Range::positive(), "time constant of the thermal drift");
  table.number("noise", noise, "N", signal, "RMS of a sensor at rest");
  table.number("noise_turning", noise_turning, "N", signal,
               "additional RMS at 1000 rad/s, proportional to the speed");
  table.number("noise_cut", noise_cut, "1", Range::closed(0.0, 1.0),
               "additional RMS in a cut, relative to the signal");
  table.number("bearing", bearing, "N", signal, "amplitude of a bearing frequency at 1000 rad/s");
  table.number("bearing_order", bearing_order, "1", Range::closed(0.1, 50.0),
               "frequency of the bearing over that of the spindle");
}

void SpindleSensorTraits::validate() const {
  checkModes("x", x_frequency, x_damping, x_share);
  checkModes("y", y_frequency, y_damping, y_share);
  checkModes("z", z_frequency, z_damping, z_share);
}

SpindleSensor::SpindleSensor(const SpindleSensorTraits& traits, double step, double sample_rate,
                             std::uint64_t seed)
    : traits_(traits), step_(step), sample_(1.0 / sample_rate), length_(traits.length), random_(seed) {
  traits_.validate();
  for (double& z : zero_) z = traits_.zero * normal_(random_);
  for (double& d : drift_) d = traits_.drift * normal_(random_);
  updateModes();
}

void SpindleSensor::setLength(double length) {
  if (!(length >= 0.02 && length <= 0.5))
    throw Error("tool length: " + std::to_string(length / units::MM) + " mm, expected 20 .. 500 mm");
  length_ = length;
  updateModes();
}

void SpindleSensor::updateModes() {
  const double ratio = std::pow(traits_.reference_length / length_, traits_.length_exponent);
  modes_ = {modesOf(traits_.x_frequency, traits_.x_damping, traits_.x_share, ratio),
            modesOf(traits_.y_frequency, traits_.y_damping, traits_.y_share, ratio),
            modesOf(traits_.z_frequency, traits_.z_damping, traits_.z_share, ratio)};
  filters_.clear();
  for (const ModalModel& model : modes_) filters_.emplace_back(model, 1.0 / step_, Hold::first_order);
}

std::array<std::array<double, 3>, 3> SpindleSensor::shares() const {
  std::array<std::array<double, 3>, 3> share{};
  for (std::size_t pair = 0; pair < 3; ++pair) {
    const double lever = traits_.bending[pair] * (length_ + traits_.reach[pair]);
    // The mean of pair z is half the sum of its washers: bending contributes by the mismatch only,
    // compression fully.
    const double bends = pair == 2 ? traits_.mismatch[pair] : 1.0;
    share[pair] = {bends * lever * std::sin(traits_.pair_angle[pair]),
                   bends * lever * std::cos(traits_.pair_angle[pair]),
                   traits_.axial * (pair == 2   ? 1.0
                                    : pair == 0 ? traits_.mismatch[0]
                                                : -traits_.mismatch[1])};
  }
  return share;
}

void SpindleSensor::step(const std::array<double, 3>& force, double angle, double speed) {
  const double pull = traits_.unbalance * speed * speed, at = angle + traits_.unbalance_angle;
  const double fx = force[0] + pull * std::sin(at), fy = force[1] + pull * std::cos(at);
  const double c = std::cos(traits_.plane_turn), s = std::sin(traits_.plane_turn);
  const double u = filters_[0].step(c * fx + s * fy), v = filters_[1].step(c * fy - s * fx);
  moment_sum_[0] += c * u - s * v;
  moment_sum_[1] += s * u + c * v;
  moment_sum_[2] += filters_[2].step(force[2]);
  angle_ = angle;
  speed_ = std::abs(speed);
  bearing_angle_ = std::remainder(bearing_angle_ + traits_.bearing_order * speed * step_, units::TWO_PI);
  warm_ += step_ / traits_.thermal_time * (speed_ / REFERENCE_SPEED - warm_);
  ++steps_;
}

std::array<double, 6> SpindleSensor::read() {
  std::array<double, 3> filtered{};
  for (std::size_t axis = 0; axis < 3; ++axis) filtered[axis] = moment_sum_[axis] / std::max(1, steps_);
  moment_sum_ = {};
  steps_ = 0;
  time_ += sample_;
  const double turning = speed_ / REFERENCE_SPEED;
  std::array<double, 6> output{};
  for (std::size_t pair = 0; pair < 3; ++pair) {
    const double lever = traits_.bending[pair] * (length_ + traits_.reach[pair]);
    const double bend = lever * (std::sin(traits_.pair_angle[pair]) * filtered[0] +
                                 std::cos(traits_.pair_angle[pair]) * filtered[1]);
    for (std::size_t k = 0; k < 2; ++k) {
      const std::size_t i = 2 * pair + k;
      // The sign of pair y follows its second sensor (eq. 3-1).
      const double side = (k == 0 ? 1.0 : -1.0) * (pair == 1 ? -1.0 : 1.0);
      const double sensitivity = 1.0 + (k == 0 ? traits_.mismatch[pair] : -traits_.mismatch[pair]);
      const double signal = sensitivity * (side * bend + traits_.axial * filtered[2]);
      const double rms =
          std::hypot(traits_.noise, traits_.noise_turning * turning, traits_.noise_cut * signal);
      double& s = output[i];
      s = signal + zero_[i] + drift_[i] * time_ + traits_.thermal * warm_ + rms * normal_(random_);
      s += traits_.bearing * turning * std::sin(bearing_angle_ + static_cast<double>(i) * units::PI / 3.0);
      s = std::clamp(s, -traits_.preload[pair], traits_.range_limit - traits_.preload[pair]);
    }
  }
  return output;
}

}  // namespace smartmill::sim
