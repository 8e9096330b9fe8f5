#include "smartmill_hammer/analysis/idle_spindle.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Core>

#include "smartmill_core/formatted.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace hammer {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;

constexpr double STEADY = 0.005;         // [1] change of speed that ends a stretch
constexpr double LEAST_SPEED = 10.0;     // [rad/s] slower the spindle counts as standing
constexpr double LONGEST = 10.0;         // [s] of a stretch
constexpr std::size_t PARTS = 8;         // of a stretch, by whose scatter its deviation is told
constexpr double LEAST_TURNS = 3.0;      // of a part
constexpr double LOAD_SETTLE = 0.3;      // [s] that a load meter takes to stand still
constexpr std::size_t LEAST_LOADS = 4;   // readings
constexpr double LEAST_LOAD_STD = 1e-5;  // [1] of full scale: no meter is finer
constexpr double SAME_SPEED = 0.01;
/// Speeds nearer together do not tell friction's two parts.
constexpr double APART = 1.2;
/// Share of a line that its own scatter does not show: the sensor's gain.
constexpr double SYSTEMATIC = 0.002;

/// Cosine and sine of the angle in a part, beside its level and slope. @return [N] F = Re(this exp(i angle))
Complex lineOf(const std::vector<double>& angle, const std::vector<double>& force, std::size_t first,
               std::size_t last) {
  const auto rows = static_cast<Index>(last - first);
  Eigen::MatrixXd columns(rows, 4);
  Eigen::VectorXd values(rows);
  for (Index i = 0; i < rows; ++i) {
    const std::size_t at = first + static_cast<std::size_t>(i);
    columns.row(i) << 1.0, 2.0 * static_cast<double>(i) / static_cast<double>(rows) - 1.0,
        std::cos(angle[at]), std::sin(angle[at]);
    values[i] = force[at];
  }
  const Eigen::VectorXd x = linear::solveSymmetric(Eigen::MatrixXd(columns.transpose() * columns),
                                                   Eigen::VectorXd(columns.transpose() * values));
  return {x[2], -x[3]};
}

template <class T>
void append(std::vector<T>& all, const std::vector<T>& more) {
  all.insert(all.end(), more.begin(), more.end());
}

/// Of stretches, those at speeds that others have too.
template <class T>
std::vector<T> atSpeedsOf(const std::vector<T>& others, const std::vector<T>& stretches, bool shared = true) {
  std::vector<T> chosen;
  for (const T& s : stretches) {
    const bool known = std::any_of(others.begin(), others.end(), [&s](const T& o) {
      return std::abs(o.speed - s.speed) < SAME_SPEED * s.speed;
    });
    if (known == shared) chosen.push_back(s);
  }
  return chosen;
}

double correlation(const std::vector<double>& values) {
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
  closeTurning();
  closeReading();
  if (!seen_.lines.empty() || !seen_.loads.empty()) {
    IdleRecord& record = records_[condition_->tool_name];
    for (const auto& [channel, lines] : seen_.lines) append(record.lines[channel], lines);
    append(record.loads, seen_.loads);
    if (told_) told_(condition_->tool_name, seen_);
    seen_ = {};
  }
  condition_ = condition;
}

void IdleSpindle::handle(const SpindleAngle& angle) {
  angle_ = angle;
  if (turning_ && std::abs(angle.speed - turning_->speed) > STEADY * turning_->speed) closeTurning();
}

void IdleSpindle::handle(const SampleBlock& force) {
  if (!inAir() || !angle_ || angle_->speed < LEAST_SPEED) return;
  if (turning_ && (turning_->channels != force.channels || force.stamp - turning_->from > LONGEST))
    closeTurning();
  if (!turning_) {
    turning_ = Turning{force.stamp, force.stamp, angle_->speed, {}, force.channels, {}};
    turning_->force.resize(force.channels.size());
  }
  turning_->to = force.timeOf(force.size());
  for (std::size_t i = 0; i < force.size(); ++i) {
    turning_->angle.push_back(angle_->angle + angle_->speed * (force.timeOf(i) - angle_->stamp));
    for (std::size_t c = 0; c < force.channels.size(); ++c) turning_->force[c].push_back(force.at(i, c));
  }
  for (std::size_t c = 0; c < force.channels.size(); ++c) {
    if (force.units[c] != "N") turning_->force[c].clear();
  }
}

void IdleSpindle::handle(const LoadSample& load) {
  if (!inAir() || load.spindle_speed < LEAST_SPEED || !std::isfinite(load.spindle_load)) {
    closeReading();
    return;
  }
  if (reading_ && (std::abs(load.spindle_speed - reading_->speed) > STEADY * reading_->speed ||
                   load.stamp - reading_->from > LONGEST))
    closeReading();
  if (!reading_) reading_ = Reading{load.stamp, load.stamp, load.spindle_speed, {}};
  reading_->to = load.stamp;
  if (load.stamp - reading_->from >= LOAD_SETTLE) reading_->load.push_back(load.spindle_load);
}

void IdleSpindle::closeTurning() {
  if (!turning_) return;
  const Turning t = std::move(*turning_);
  turning_.reset();
  const double turns = t.speed * (t.to - t.from) / units::TWO_PI;
  if (turns < LEAST_TURNS * static_cast<double>(PARTS)) return;
  for (std::size_t c = 0; c < t.channels.size(); ++c) {
    const std::vector<double>& force = t.force[c];
    // Nothing turns along the spindle.
    if (force.size() != t.angle.size() || t.channels[c] == "fz" || firstNotFinite(force) < force.size())
      continue;
    std::vector<Complex> parts;
    for (std::size_t p = 0; p < PARTS; ++p)
      parts.push_back(lineOf(t.angle, force, p * force.size() / PARTS, (p + 1) * force.size() / PARTS));
    Complex middle;
    for (const Complex& p : parts) middle += p / static_cast<double>(PARTS);
    double squares = 0.0;
    for (const Complex& p : parts) squares += std::norm(p - middle);
    const double n = static_cast<double>(PARTS);
    seen_.lines[t.channels[c]].push_back({t.to, t.speed, middle, std::sqrt(squares / (2.0 * (n - 1.0) * n))});
  }
}

void IdleSpindle::closeReading() {
  if (!reading_) return;
  const Reading r = std::move(*reading_);
  reading_.reset();
  if (r.load.size() < LEAST_LOADS) return;
  const double along = correlation(r.load), n = static_cast<double>(r.load.size());
  const double std_dev = standardDeviation(r.load) * std::sqrt((1.0 + along) / (1.0 - along) / n);
  seen_.loads.push_back({r.to, r.speed, mean(r.load), std::max(std_dev, LEAST_LOAD_STD)});
}

void IdleSpindle::interrupt() {
  turning_.reset();
  reading_.reset();
  angle_.reset();
  condition_.reset();
  seen_ = {};
}

void IdleSpindle::finish() {
  if (condition_) handle(*condition_);
  interrupt();
}

IdleSpindlePipeline::IdleSpindlePipeline(double hold_back, IdleSpindle::Told told)
    : idle_(std::move(told)),
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

Unbalance unbalanceOf(const std::vector<TurningLine>& lines, const std::optional<ModalModel>& sensor) {
  std::vector<Complex> single;
  std::vector<double> weight;
  double weights = 0.0;
  Complex sum;
  for (const TurningLine& line : lines) {
    const Complex shown =
        line.speed * line.speed * (sensor ? sensor->response(line.speed / units::TWO_PI) : Complex(1.0));
    const double std_dev =
        std::max(std::hypot(line.std, SYSTEMATIC * std::abs(line.force)), 1e-12) / std::abs(shown);
    single.push_back(line.force / shown);
    weight.push_back(1.0 / (std_dev * std_dev));
    weights += weight.back();
    sum += weight.back() * single.back();
  }
  if (lines.empty()) return {};
  Unbalance u{sum / weights, 1.0 / std::sqrt(weights)};
  double chi2 = 0.0;
  for (std::size_t k = 0; k < single.size(); ++k) chi2 += weight[k] * std::norm(single[k] - u.value);
  if (single.size() > 1)
    u.std *= std::sqrt(std::max(1.0, chi2 / (2.0 * static_cast<double>(single.size() - 1))));
  return u;
}

std::optional<IdleFriction> frictionOf(const std::vector<IdleLoad>& loads) {
  double slowest = INFINITY, fastest = 0.0;
  double a = 0.0, b = 0.0, c = 0.0, p = 0.0, q = 0.0;  // normal equations of (w, w^2)
  for (const IdleLoad& l : loads) {
    const double w = l.speed, weight = 1.0 / (l.std * l.std);
    slowest = std::min(slowest, w);
    fastest = std::max(fastest, w);
    a += weight * w * w;
    b += weight * w * w * w;
    c += weight * w * w * w * w;
    p += weight * w * l.load;
    q += weight * w * w * l.load;
  }
  if (!(fastest > APART * slowest)) return {};
  const double determinant = a * c - b * b;
  IdleFriction f;
  f.coulomb = (c * p - b * q) / determinant;
  f.viscous = (a * q - b * p) / determinant;
  double chi2 = 0.0;
  for (const IdleLoad& l : loads)
    chi2 += std::pow((l.load - (f.coulomb + f.viscous * l.speed) * l.speed) / l.std, 2);
  const double freedom = static_cast<double>(loads.size()) - 2.0;
  // The law itself is not all that friction does: what it leaves counts as noise.
  const double wide = freedom > 0.0 ? std::max(1.0, chi2 / freedom) : 1.0;
  f.coulomb_std = std::sqrt(wide * c / determinant);
  f.viscous_std = std::sqrt(wide * a / determinant);
  return f;
}

double endOf(const IdleRecord& record) {
  double end = record.loads.empty() ? 0.0 : record.loads.back().stamp;
  for (const auto& [channel, lines] : record.lines) end = std::max(end, lines.back().stamp);
  return end;
}

bool addSpeeds(IdleRecord& record, const IdleRecord& more) {
  bool any = false;
  for (const auto& [channel, lines] : more.lines) {
    const std::vector<TurningLine> fresh = atSpeedsOf(record.lines[channel], lines, false);
    any = any || !fresh.empty();
    append(record.lines[channel], fresh);
  }
  const std::vector<IdleLoad> fresh = atSpeedsOf(record.loads, more.loads, false);
  append(record.loads, fresh);
  return any || !fresh.empty();
}

std::vector<HealthChange> idleChanges(const IdleRecord& before, const IdleRecord& now,
                                      const std::map<std::string, ModalModel>& sensors,
                                      const HealthAllowance& allowance) {
  std::vector<HealthChange> changes;
  for (const auto& [channel, lines] : before.lines) {
    const auto later = now.lines.find(channel);
    if (later == now.lines.end()) continue;
    const auto known = sensors.find(channel);
    const auto sensor = known == sensors.end() ? std::optional<ModalModel>() : known->second;
    std::vector<TurningLine> first = atSpeedsOf(later->second, lines),
                             then = atSpeedsOf(lines, later->second);
    if (first.empty()) first = lines, then = later->second;
    const Unbalance old = unbalanceOf(first, sensor), fresh = unbalanceOf(then, sensor);
    // As vectors: an unbalance that has turned is another one.
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
  std::vector<IdleLoad> told;
  for (const IdleLoad& l : atSpeedsOf(now.loads, before.loads)) {
    if (!atSpeedsOf({l}, told).empty()) continue;
    told.push_back(l);
    const IdleLoad later = atSpeedsOf({l}, now.loads).back();
    changes.push_back(valueChange(formatted("load in air at %.0f rpm", units::rpmFromRadPerSec(l.speed)),
                                  {l.load, l.std}, {later.load, later.std}, allowance.friction));
  }
  return changes;
}

}  // namespace hammer
}  // namespace smartmill
