#include "smartmill_hammer/analysis/idle_spindle.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Core>

#include "smartmill_core/cutting/friction.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;

/// Fit of mean, slope, cosine and sine of the angle over a section. @return [N] F = Re(this exp(i angle))
Complex synchronousForce(const std::vector<double>& angle, const std::vector<double>& force,
                         std::size_t first, std::size_t last) {
  const auto rows = static_cast<Index>(last - first);
  Eigen::MatrixXd columns(rows, 4);
  Eigen::VectorXd values(rows);
  for (Index i = 0; i < rows; ++i) {
    const std::size_t sample = first + static_cast<std::size_t>(i);
    columns.row(i) << 1.0, 2.0 * static_cast<double>(i) / static_cast<double>(rows) - 1.0,
        std::cos(angle[sample]), std::sin(angle[sample]);
    values[i] = force[sample];
  }
  const Eigen::VectorXd x = linear::solveSymmetric(Eigen::MatrixXd(columns.transpose() * columns),
                                                   Eigen::VectorXd(columns.transpose() * values));
  return {x[2], -x[3]};
}

template <class T>
void append(std::vector<T>& all, const std::vector<T>& more) {
  all.insert(all.end(), more.begin(), more.end());
}

/// The segments at speeds that others have too; with `shared` false, the remaining ones.
template <class T>
std::vector<T> atSpeedsOf(const std::vector<T>& others, const std::vector<T>& segments, bool shared = true) {
  std::vector<T> chosen;
  for (const T& s : segments) {
    const bool known = std::any_of(others.begin(), others.end(), [&s](const T& o) {
      return std::abs(o.speed - s.speed) < IdleSpindleOptions().same_speed * s.speed;
    });
    if (known == shared) chosen.push_back(s);
  }
  return chosen;
}

double lagOneCorrelation(const std::vector<double>& values) {
  const double level = mean(values);
  double along = 0.0, power = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    power += std::pow(values[i] - level, 2);
    if (i > 0) along += (values[i] - level) * (values[i - 1] - level);
  }
  return power > 0.0 ? std::clamp(along / power, 0.0, 0.95) : 0.0;
}

}  // namespace

void IdleSpindle::handle(const CuttingCondition& condition) {
  closeForceSegment();
  closeLoadSegment();
  if (!current_.forces.empty() || !current_.loads.empty()) {
    AirCutRecord& record = records_[condition_->tool_name];
    for (const auto& [channel, forces] : current_.forces) append(record.forces[channel], forces);
    append(record.loads, current_.loads);
    if (on_record_) on_record_(condition_->tool_name, current_);
    current_ = {};
  }
  condition_ = condition;
}

void IdleSpindle::handle(const SpindleAngle& angle) {
  angle_ = angle;
  if (force_segment_ &&
      std::abs(angle.speed - force_segment_->speed) > options_.steady_speed * force_segment_->speed)
    closeForceSegment();
}

void IdleSpindle::handle(const SampleBlock& force) {
  if (!inAir() || !angle_ || angle_->speed < options_.least_speed) return;
  if (force_segment_ && (force_segment_->channels != force.channels ||
                         force.stamp - force_segment_->from > options_.longest_segment))
    closeForceSegment();
  if (!force_segment_) {
    force_segment_ = ForceSegment{force.stamp, force.stamp, angle_->speed, {}, force.channels, {}};
    force_segment_->force.resize(force.channels.size());
  }
  force_segment_->to = force.timeOf(force.size());
  for (std::size_t i = 0; i < force.size(); ++i) {
    force_segment_->angle.push_back(angle_->angle + angle_->speed * (force.timeOf(i) - angle_->stamp));
    for (std::size_t c = 0; c < force.channels.size(); ++c)
      force_segment_->force[c].push_back(force.at(i, c));
  }
  for (std::size_t c = 0; c < force.channels.size(); ++c) {
    if (force.units[c] != "N") force_segment_->force[c].clear();
  }
}

void IdleSpindle::handle(const LoadSample& load) {
  if (!inAir() || load.spindle_speed < options_.least_speed || !std::isfinite(load.spindle_load)) {
    closeLoadSegment();
    return;
  }
  if (load_segment_ &&
      (std::abs(load.spindle_speed - load_segment_->speed) > options_.steady_speed * load_segment_->speed ||
       load.stamp - load_segment_->from > options_.longest_segment))
    closeLoadSegment();
  if (!load_segment_) load_segment_ = LoadSegment{load.stamp, load.stamp, load.spindle_speed, {}};
  load_segment_->to = load.stamp;
  if (load.stamp - load_segment_->from >= options_.load_settle)
    load_segment_->load.push_back(load.spindle_load);
}

void IdleSpindle::closeForceSegment() {
  if (!force_segment_) return;
  const ForceSegment t = std::move(*force_segment_);
  force_segment_.reset();
  const double revolutions = t.speed * (t.to - t.from) / units::TWO_PI;
  if (revolutions < options_.least_revolutions * static_cast<double>(options_.sections)) return;
  for (std::size_t c = 0; c < t.channels.size(); ++c) {
    const std::vector<double>& force = t.force[c];
    // No unbalance along the spindle.
    if (force.size() != t.angle.size() || t.channels[c] == "fz" || firstNotFinite(force) < force.size())
      continue;
    std::vector<Complex> amplitudes;
    for (std::size_t p = 0; p < options_.sections; ++p)
      amplitudes.push_back(synchronousForce(t.angle, force, p * force.size() / options_.sections,
                                            (p + 1) * force.size() / options_.sections));
    Complex middle;
    for (const Complex& p : amplitudes) middle += p / static_cast<double>(options_.sections);
    double squares = 0.0;
    for (const Complex& p : amplitudes) squares += std::norm(p - middle);
    const double n = static_cast<double>(options_.sections);
    current_.forces[t.channels[c]].push_back(
        {t.to, t.speed, middle, std::sqrt(squares / (2.0 * (n - 1.0) * n))});
  }
}

void IdleSpindle::closeLoadSegment() {
  if (!load_segment_) return;
  const LoadSegment r = std::move(*load_segment_);
  load_segment_.reset();
  if (r.load.size() < options_.least_loads) return;
  const double lag_one = lagOneCorrelation(r.load), n = static_cast<double>(r.load.size());
  const double std_dev = standardDeviation(r.load) * std::sqrt((1.0 + lag_one) / (1.0 - lag_one) / n);
  current_.loads.push_back({r.to, r.speed, mean(r.load), std::max(std_dev, options_.least_load_std)});
}

void IdleSpindle::interrupt() {
  force_segment_.reset();
  load_segment_.reset();
  angle_.reset();
  condition_.reset();
  current_ = {};
}

void IdleSpindle::finish() {
  if (condition_) handle(*condition_);
  interrupt();
}

IdleSpindlePipeline::IdleSpindlePipeline(double hold_back, IdleSpindle::RecordCallback on_record)
    : idle_(std::move(on_record)),
      sorter_(hold_back),
      conditions_(sorter_.addLatched(names::CUTTING_CONDITION)),
      angles_(sorter_.addOptional(names::SPINDLE_ANGLE)),
      blocks_(sorter_.addOptional(names::DYNAMOMETER)),
      loads_(sorter_.addOptional(names::CNC_LOAD)) {
  sorter_.onRestart([this] { idle_.interrupt(); });
}

void IdleSpindlePipeline::finish() {
  sorter_.flush();
  idle_.finish();
}

Unbalance unbalanceOf(const std::vector<SynchronousForce>& forces, const std::optional<ModalModel>& sensor) {
  std::vector<Complex> single;
  std::vector<double> weight;
  double weights = 0.0;
  Complex sum;
  for (const SynchronousForce& force : forces) {
    const Complex gain =
        force.speed * force.speed * (sensor ? sensor->response(force.speed / units::TWO_PI) : Complex(1.0));
    const double std_dev =
        std::max(std::hypot(force.std, IdleSpindleOptions().gain_error * std::abs(force.force)), 1e-12) /
        std::abs(gain);
    single.push_back(force.force / gain);
    weight.push_back(1.0 / (std_dev * std_dev));
    weights += weight.back();
    sum += weight.back() * single.back();
  }
  if (forces.empty()) return {};
  Unbalance u{sum / weights, 1.0 / std::sqrt(weights)};
  double chi2 = 0.0;
  for (std::size_t k = 0; k < single.size(); ++k) chi2 += weight[k] * std::norm(single[k] - u.value);
  if (single.size() > 1)
    u.std *= std::sqrt(std::max(1.0, chi2 / (2.0 * static_cast<double>(single.size() - 1))));
  return u;
}

std::optional<IdleFriction> frictionOf(const std::vector<AirCutLoad>& loads) {
  double slowest = INFINITY, fastest = 0.0;
  double a = 0.0, b = 0.0, c = 0.0, p = 0.0, q = 0.0;  // normal equations of (w, w^2)
  for (const AirCutLoad& l : loads) {
    const double w = l.speed, weight = 1.0 / (l.std * l.std);
    slowest = std::min(slowest, w);
    fastest = std::max(fastest, w);
    a += weight * w * w;
    b += weight * w * w * w;
    c += weight * w * w * w * w;
    p += weight * w * l.load;
    q += weight * w * w * l.load;
  }
  if (!(fastest > IdleSpindleOptions().least_speed_ratio * slowest)) return {};
  const double determinant = a * c - b * b;
  IdleFriction f;
  f.coulomb = (c * p - b * q) / determinant;
  f.viscous = (a * q - b * p) / determinant;
  double chi2 = 0.0;
  for (const AirCutLoad& l : loads)
    chi2 += std::pow((l.load - LinearFriction{f.viscous, f.coulomb}.at(l.speed) * l.speed) / l.std, 2);
  const double freedom = static_cast<double>(loads.size()) - 2.0;
  // The residual of the law counts as noise.
  const double wide = freedom > 0.0 ? std::max(1.0, chi2 / freedom) : 1.0;
  f.coulomb_std = std::sqrt(wide * c / determinant);
  f.viscous_std = std::sqrt(wide * a / determinant);
  return f;
}

double endTime(const AirCutRecord& record) {
  double end = record.loads.empty() ? 0.0 : record.loads.back().stamp;
  for (const auto& [channel, forces] : record.forces) end = std::max(end, forces.back().stamp);
  return end;
}

bool addNewSpeeds(AirCutRecord& record, const AirCutRecord& more) {
  bool any = false;
  for (const auto& [channel, forces] : more.forces) {
    const std::vector<SynchronousForce> fresh = atSpeedsOf(record.forces[channel], forces, false);
    any = any || !fresh.empty();
    append(record.forces[channel], fresh);
  }
  const std::vector<AirCutLoad> fresh = atSpeedsOf(record.loads, more.loads, false);
  append(record.loads, fresh);
  return any || !fresh.empty();
}

std::vector<HealthChange> airCutChanges(const AirCutRecord& before, const AirCutRecord& now,
                                        const std::map<std::string, ModalModel>& sensors,
                                        const HealthAllowance& allowance) {
  std::vector<HealthChange> changes;
  for (const auto& [channel, forces] : before.forces) {
    const auto later = now.forces.find(channel);
    if (later == now.forces.end()) continue;
    const auto known = sensors.find(channel);
    const auto sensor = known == sensors.end() ? std::optional<ModalModel>() : known->second;
    std::vector<SynchronousForce> first = atSpeedsOf(later->second, forces),
                                  then = atSpeedsOf(forces, later->second);
    if (first.empty()) first = forces, then = later->second;
    const Unbalance old = unbalanceOf(first, sensor), fresh = unbalanceOf(then, sensor);
    // As vectors: an unbalance at another angle is a change.
    const double size = std::abs(old.value), apart = std::abs(fresh.value - old.value);
    const double deviation =
        std::sqrt(old.std * old.std + fresh.std * fresh.std + std::pow(allowance.unbalance * size, 2));
    changes.push_back({"unbalance seen by " + channel + " [kg m]", size, std::abs(fresh.value),
                       std::abs(fresh.value) / size - 1.0, deviation > 0.0 ? apart / deviation : 0.0});
  }
  const auto old = frictionOf(before.loads), fresh = frictionOf(now.loads);
  if (old && fresh) {
    changes.push_back(valueChange("friction with speed, of the load meter's scale [s2]",
                                  {old->viscous, old->viscous_std}, {fresh->viscous, fresh->viscous_std},
                                  allowance.friction));
    changes.push_back(valueChange("friction at any speed, of the load meter's scale [s]",
                                  {old->coulomb, old->coulomb_std}, {fresh->coulomb, fresh->coulomb_std},
                                  allowance.friction));
  }
  std::vector<AirCutLoad> compared;
  for (const AirCutLoad& l : atSpeedsOf(now.loads, before.loads)) {
    if (!atSpeedsOf({l}, compared).empty()) continue;
    compared.push_back(l);
    const AirCutLoad later = atSpeedsOf({l}, now.loads).back();
    changes.push_back(valueChange(formatted("load in air at %.0f rpm", units::rpmFromRadPerSec(l.speed)),
                                  {l.load, l.std}, {later.load, later.std}, allowance.friction));
  }
  return changes;
}

}  // namespace smartmill::hammer
