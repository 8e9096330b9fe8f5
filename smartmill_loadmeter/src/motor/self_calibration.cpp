#include "smartmill_loadmeter/motor/self_calibration.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

constexpr std::size_t MIN_CUTS = 3;      // cuts
constexpr double SAME_FEED_RATIO = 1.1;  // largest ratio of equal feeds

bool isSameDirection(const MotorMeasurement& a, const MotorMeasurement& b, std::size_t axis) {
  return a.range[axis] && b.velocity[axis] * a.velocity[axis] > 0.0;
}

}  // namespace

void SelfCalibration::clear() {
  air_.clear();
  cuts_.clear();
  friction_ = {};
  calibration_.reset();
}

void SelfCalibration::air(const MotorMeasurement& measurement, double stamp) {
  if (air_.size() == MOST) air_.erase(air_.begin());
  air_.push_back({measurement, stamp});
  for (std::size_t a = 0; a < 3; ++a) {
    if (measurement.range[a]) updateFriction(a);
  }
}

// The friction laws of a spindle also apply to a slide, with range over velocity.
void SelfCalibration::updateFriction(std::size_t axis) {
  std::vector<TimedAirCut> all;
  std::set<double> speeds;
  double temperatures = 0.0;  // [K] sum
  for (const Air& one : air_) {
    if (!one.measurement.range[axis]) continue;
    temperatures += one.measurement.temperature[axis];
    const double speed = std::abs(one.measurement.velocity[axis]);
    all.push_back({{speed, *one.measurement.range[axis] * speed, 0.0}, one.stamp - air_.front().stamp});
    speeds.insert(speed);
  }
  if (speeds.size() < 2 || *speeds.rbegin() < SAME_FEED_RATIO * *speeds.begin()) return;
  temperature_[axis] = temperatures / static_cast<double>(all.size());
  slowest_[axis] = *speeds.begin(), fastest_[axis] = *speeds.rbegin();
  try {
    friction_[axis] = fitFrictionLaws(all, 1.0, 0.0).front();
  } catch (const Error&) {
    friction_[axis].reset();
  }
}

void SelfCalibration::cut(const MotorMeasurement& measurement, const ForceEstimate& reference) {
  if (cuts_.size() == MOST) cuts_.erase(cuts_.begin());
  cuts_.push_back({measurement, reference});
  calibrate();
}

std::vector<MotorMeasurement> SelfCalibration::airFor(const MotorMeasurement& cut) const {
  std::vector<MotorMeasurement> all;
  for (const Air& one : air_) all.push_back(one.measurement);
  for (std::size_t a = 0; a < 3; ++a) {
    if (!cut.range[a] || !friction_[a]) continue;
    const double speed = std::abs(cut.velocity[a]);
    const bool near = std::any_of(air_.begin(), air_.end(), [&](const Air& one) {
      return isSameDirection(one.measurement, cut, a) &&
             std::abs(std::log(one.measurement.velocity[a] / cut.velocity[a])) < std::log(SAME_FEED_RATIO);
    });
    if (near || speed < slowest_[a] / SAME_FEED_RATIO || speed > fastest_[a] * SAME_FEED_RATIO) continue;
    MotorMeasurement by_law;
    by_law.velocity[a] = cut.velocity[a];
    by_law.range[a] = friction_[a]->law.torque(speed, air_.back().stamp - air_.front().stamp);
    all.push_back(by_law);
  }
  return all;
}

// F = m (I - Ia) from cuts whose force another sensor measured; its systematic error is common to all cuts.
std::optional<DriveCalibration> SelfCalibration::drive(std::size_t axis) const {
  MotorCalibration unit;
  unit.drive[axis] = DriveCalibration{{1.0, 0.0}, 0.0, static_cast<int>(MIN_CUTS), {}, {}};
  double rr = 0.0, rf = 0.0, share = 0.0;
  std::vector<std::pair<double, double>> points;  // [A], [N] against the motion
  for (const Cut& cut : cuts_) {
    if (!cut.measurement.range[axis]) continue;
    const MotorForce rise = forceFromMotors(cut.measurement, airFor(cut.measurement), unit, parameters_);
    const Estimate& reference = cut.reference.mean[axis];
    if (!rise.force[axis] || !(reference.std_dev < std::abs(reference.value))) continue;
    const double sign = cut.measurement.velocity[axis] > 0.0 ? -1.0 : 1.0;
    points.emplace_back(sign * rise.force[axis]->value, sign * reference.value);
    share += reference.std_dev / std::abs(reference.value);
  }
  if (points.size() < MIN_CUTS) return std::nullopt;
  for (const auto& [r, f] : points) rr += r * r, rf += r * f;
  if (!(rr > 0.0)) return std::nullopt;
  DriveCalibration found;
  found.cuts = static_cast<int>(points.size());
  const double count = static_cast<double>(points.size());
  found.newton_per_ampere.value = rf / rr;
  double left = 0.0;
  for (const auto& [r, f] : points) left += std::pow(f - found.newton_per_ampere.value * r, 2);
  found.scatter = std::sqrt(left / (count - 1.0));
  for (const auto& [r, f] : points) found.samples.add({r}, f);
  if (parameters_.motorMethod() == MotorMethod::anfis) found.anfis = found.samples.learn();
  found.newton_per_ampere.std_dev =
      std::hypot(found.scatter / std::sqrt(rr), share / count * found.newton_per_ampere.value);
  return found;
}

std::vector<SpindleCut> SelfCalibration::spindleCuts() const {
  std::vector<SpindleCut> cuts;
  for (const Cut& cut : cuts_) {
    if (!cut.measurement.spindle_range) continue;
    const MotorMeasurement* air = nullptr;
    for (const Air& one : air_) {
      const bool same = std::abs(one.measurement.spindle_speed / cut.measurement.spindle_speed - 1.0) <
                        SAME_FEED_RATIO - 1.0;
      if (one.measurement.spindle_range && same) air = &one.measurement;
    }
    const double rpm = units::rpmFromRadPerSec(cut.measurement.spindle_speed);
    if (!air || !(*cut.measurement.spindle_range > *air->spindle_range) ||
        !(cut.reference.torque.value > 0.0))
      continue;
    cuts.push_back({rpm, *cut.measurement.spindle_range - *air->spindle_range, cut.reference.torque.value});
  }
  return cuts;
}

std::optional<TorquePowerLaw> SelfCalibration::spindle(const std::vector<SpindleCut>& cuts) const {
  if (cuts.size() < MIN_CUTS) return std::nullopt;
  double fastest = 0.0;
  for (const SpindleCut& cut : cuts) fastest = std::max(fastest, cut.speed_rpm);
  try {
    return TorquePowerLaw(cuts, fastest);  // one law over all speeds of the cuts
  } catch (const Error&) {
    return std::nullopt;
  }
}

void SelfCalibration::calibrate() {
  MotorCalibration found;
  bool any = false;
  for (std::size_t a = 0; a < 3; ++a) {
    found.drive[a] = drive(a);
    any = any || found.drive[a];
  }
  const std::vector<SpindleCut> spindle_cuts = spindleCuts();
  found.spindle = spindle(spindle_cuts);
  for (const SpindleCut& cut : spindle_cuts) found.spindle_samples.add({cut.rise, cut.speed_rpm}, cut.torque);
  if (parameters_.motorMethod() == MotorMethod::anfis) found.spindle_anfis = found.spindle_samples.learn();
  if (any || found.spindle) calibration_ = found;
}

std::string SelfCalibration::text(const std::array<std::optional<Estimate>, 3>& bandwidth) const {
  std::string all;
  for (std::size_t a = 0; a < 3; ++a) {
    std::string one;
    const auto add = [&](const std::string& what) { one += (one.empty() ? "" : ", ") + what; };
    if (calibration_ && calibration_->drive[a]) {
      const DriveCalibration& d = *calibration_->drive[a];
      add(formatted("%.1f +- %.1f N/A from %d cuts", d.newton_per_ampere.value, d.newton_per_ampere.std_dev,
                    d.cuts));
      if (const auto errors = driveErrors(d.samples)) add(textOf(*errors, "N"));
    }
    if (friction_[a]) {
      const FittedFriction& f = *friction_[a];
      add(formatted("air current %.3f A + %.2f A s/m (%s)", f.law.coulomb, f.law.viscous,
                    f.terms.name().c_str()) +
          (std::isfinite(temperature_[a]) ? formatted(" at %.1f K", temperature_[a]) : ""));
    }
    if (bandwidth[a]) add(formatted("bandwidth %.1f +- %.1f Hz", bandwidth[a]->value, bandwidth[a]->std_dev));
    if (!one.empty()) all += std::string(all.empty() ? "" : "; ") + "XYZ"[a] + " " + one;
  }
  if (calibration_ && calibration_->spindle) {
    all += std::string(all.empty() ? "" : "; ") +
           formatted("spindle torque +- %.3f N m", calibration_->spindle->scatter());
    if (const auto errors = spindleErrors(calibration_->spindle_samples))
      all += ", " + textOf(*errors, "N m");
  }
  return all;
}

}  // namespace smartmill::loadmeter
