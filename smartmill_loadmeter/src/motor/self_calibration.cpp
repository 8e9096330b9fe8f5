#include "smartmill_loadmeter/motor/self_calibration.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

constexpr std::size_t FEWEST = 3;  // cuts
constexpr double NEAR = 1.1;       // feeds are the same within

bool sameWay(const MotorReading& a, const MotorReading& b, std::size_t axis) {
  return a.range[axis] && b.velocity[axis] * a.velocity[axis] > 0.0;
}

}  // namespace

void SelfCalibration::clear() {
  air_.clear();
  cuts_.clear();
  friction_ = {};
  calibration_.reset();
}

void SelfCalibration::air(const MotorReading& reading, double stamp) {
  air_.push_back({reading, stamp});
  for (std::size_t a = 0; a < 3; ++a) {
    if (reading.range[a]) learnFriction(a);
  }
}

// Laws of a spindle's friction serve a slide: range over speed.
void SelfCalibration::learnFriction(std::size_t axis) {
  std::vector<TimedAirCut> all;
  std::set<double> speeds;
  for (const Air& one : air_) {
    if (!one.reading.range[axis]) continue;
    const double speed = std::abs(one.reading.velocity[axis]);
    all.push_back({{speed, *one.reading.range[axis] * speed, 0.0}, one.stamp - air_.front().stamp});
    speeds.insert(speed);
  }
  if (speeds.size() < 2 || *speeds.rbegin() < NEAR * *speeds.begin()) return;
  slowest_[axis] = *speeds.begin(), fastest_[axis] = *speeds.rbegin();
  try {
    friction_[axis] = fitFrictionLaws(all, 1.0, 0.0).front();
  } catch (const Error&) {
    friction_[axis].reset();
  }
}

void SelfCalibration::cut(const MotorReading& reading, const ForceEstimate& seen) {
  cuts_.push_back({reading, seen});
  calibrate();
}

std::vector<MotorReading> SelfCalibration::airFor(const MotorReading& cut) const {
  std::vector<MotorReading> all;
  for (const Air& one : air_) all.push_back(one.reading);
  for (std::size_t a = 0; a < 3; ++a) {
    if (!cut.range[a] || !friction_[a]) continue;
    const double speed = std::abs(cut.velocity[a]);
    const bool near = std::any_of(air_.begin(), air_.end(), [&](const Air& one) {
      return sameWay(one.reading, cut, a) &&
             std::abs(std::log(one.reading.velocity[a] / cut.velocity[a])) < std::log(NEAR);
    });
    if (near || speed < slowest_[a] / NEAR || speed > fastest_[a] * NEAR) continue;
    MotorReading by_law;
    by_law.velocity[a] = cut.velocity[a];
    by_law.range[a] = friction_[a]->law.torque(speed, air_.back().stamp - air_.front().stamp);
    all.push_back(by_law);
  }
  return all;
}

// F = m (I - Ia) by cuts whose force another sensor saw, each as good as it saw it; what its own error may be
// is common to all.
std::optional<DriveCalibration> SelfCalibration::drive(std::size_t axis) const {
  MotorCalibration unit;
  unit.drive[axis] = DriveCalibration{{1.0, 0.0}, 0.0, static_cast<int>(FEWEST)};
  double rr = 0.0, rf = 0.0, share = 0.0;
  std::vector<std::pair<double, double>> points;  // [A], [N] against the motion
  for (const Cut& cut : cuts_) {
    if (!cut.reading.range[axis]) continue;
    const MotorForce rise = forceFromMotors(cut.reading, airFor(cut.reading), unit, parameters_);
    const Estimate& seen = cut.seen.mean[axis];
    if (!rise.force[axis] || !(seen.std_dev < std::abs(seen.value))) continue;
    const double sign = cut.reading.velocity[axis] > 0.0 ? -1.0 : 1.0;
    points.emplace_back(sign * rise.force[axis]->value, sign * seen.value);
    share += seen.std_dev / std::abs(seen.value);
  }
  if (points.size() < FEWEST) return std::nullopt;
  for (const auto& [r, f] : points) rr += r * r, rf += r * f;
  if (!(rr > 0.0)) return std::nullopt;
  DriveCalibration found;
  found.cuts = static_cast<int>(points.size());
  const double count = static_cast<double>(points.size());
  found.newton_per_ampere.value = rf / rr;
  double left = 0.0;
  for (const auto& [r, f] : points) left += std::pow(f - found.newton_per_ampere.value * r, 2);
  found.scatter = std::sqrt(left / (count - 1.0));
  found.newton_per_ampere.std_dev =
      std::hypot(found.scatter / std::sqrt(rr), share / count * found.newton_per_ampere.value);
  return found;
}

std::optional<TorquePowerLaw> SelfCalibration::spindle() const {
  std::vector<SpindleCut> cuts;
  double fastest = 0.0;
  for (const Cut& cut : cuts_) {
    if (!cut.reading.spindle_range) continue;
    const MotorReading* air = nullptr;
    for (const Air& one : air_) {
      const bool same = std::abs(one.reading.spindle_speed / cut.reading.spindle_speed - 1.0) < NEAR - 1.0;
      if (one.reading.spindle_range && same) air = &one.reading;
    }
    const double rpm = units::rpmFromRadPerSec(cut.reading.spindle_speed);
    if (!air || !(*cut.reading.spindle_range > *air->spindle_range) || !(cut.seen.torque.value > 0.0))
      continue;
    cuts.push_back({rpm, *cut.reading.spindle_range - *air->spindle_range, cut.seen.torque.value});
    fastest = std::max(fastest, rpm);
  }
  if (cuts.size() < FEWEST) return std::nullopt;
  try {
    return TorquePowerLaw(cuts, fastest);  // one law over the speeds that were cut at
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
  found.spindle = spindle();
  if (any || found.spindle) calibration_ = found;
}

std::string SelfCalibration::text(const std::array<std::optional<Estimate>, 3>& bandwidth) const {
  std::string all;
  for (std::size_t a = 0; a < 3; ++a) {
    std::string one;
    const auto add = [&](const std::string& what) { one += (one.empty() ? "" : ", ") + what; };
    if (calibration_ && calibration_->drive[a]) {
      const DriveCalibration& d = *calibration_->drive[a];
      add(formatted("%.1f +- %.1f N/A by %d cuts", d.newton_per_ampere.value, d.newton_per_ampere.std_dev,
                    d.cuts));
    }
    if (friction_[a]) {
      const FittedFriction& f = *friction_[a];
      add(formatted("air current %.3f A + %.2f A s/m (%s)", f.law.coulomb, f.law.viscous,
                    f.shape.name().c_str()));
    }
    if (bandwidth[a])
      add(formatted("follows to %.1f +- %.1f Hz", bandwidth[a]->value, bandwidth[a]->std_dev));
    if (!one.empty()) all += std::string(all.empty() ? "" : "; ") + "XYZ"[a] + " " + one;
  }
  if (calibration_ && calibration_->spindle)
    all += std::string(all.empty() ? "" : "; ") +
           formatted("spindle's torque within %.3f N m", calibration_->spindle->scatter());
  return all;
}

}  // namespace smartmill::loadmeter
