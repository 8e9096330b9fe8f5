#include "load_record.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/load_meter.h"
#include "smartmill_loadmeter/identification/runout_torque.h"

namespace smartmill::loadmeter {

namespace {

using Square = Eigen::Matrix<double, LOAD_COLUMNS, LOAD_COLUMNS>;

// First-order lag, exact for an input that is linear within a step.
class Lag {
 public:
  explicit Lag(double time_constant) : time_constant_(time_constant) {}
  void start(double value) { output_ = value; }
  double step(double from, double to, double dt) {
    if (dt != dt_) decay_ = std::exp(-dt / time_constant_), dt_ = dt;
    const double a = decay_, slope = dt > 0.0 ? (to - from) / dt : 0.0;
    output_ = a * output_ + (1.0 - a) * (from - slope * time_constant_) + slope * dt;
    return output_;
  }

 private:
  double time_constant_;
  double output_ = 0.0, dt_ = 0.0, decay_ = 1.0;
};

// Torque in cut per unit of Ktc, Kte: at engagement, mean, and per sample from `first` on.
struct UnitTorque {
  std::array<double, 2> at_engagement{}, mean{};
  std::array<std::vector<double>, 2> torque;
};

// Without the spindle angle the mean torque. @param steps of a revolution, linear between them.
UnitTorque unitTorque(const LoadRecord& r, const Runout& runout, std::size_t steps) {
  UnitTorque unit;
  const RunoutTorque torque(r.tool, r.engagement, runout.x, runout.y);
  unit.mean = torque.mean();
  const std::size_t n = r.voltage.size() - r.first;
  if (!r.has_angle) {
    unit.at_engagement = unit.mean;
    for (std::size_t u = 0; u < 2; ++u) unit.torque[u].assign(n, unit.mean[u]);
    return unit;
  }
  std::vector<std::array<double, 2>> table(steps + 1);
  for (std::size_t i = 0; i < steps; ++i) {
    table[i] = torque.at(units::TWO_PI * static_cast<double>(i) / static_cast<double>(steps));
  }
  table[steps] = table[0];
  for (std::size_t u = 0; u < 2; ++u) unit.torque[u].resize(n);
  for (std::size_t i = 0; i < r.angle.size(); ++i) {
    const double turn = r.angle[i] / units::TWO_PI,
                 at = (turn - std::floor(turn)) * static_cast<double>(steps);
    const std::size_t k = std::min(static_cast<std::size_t>(at), steps - 1);
    const double weight = at - static_cast<double>(k);
    for (std::size_t u = 0; u < 2; ++u) {
      unit.torque[u][i] = table[k][u] + weight * (table[k + 1][u] - table[k][u]);
    }
  }
  unit.at_engagement = torque.at(r.engage_angle);
  return unit;
}

// Combines both torques into the first.
UnitTorque weighted(UnitTorque unit, const LoadPoint& about, double factor) {
  const auto join = [&](double& first, double second) {
    first = factor * (about.ktc * first + about.kte * second);
  };
  join(unit.at_engagement[0], unit.at_engagement[1]);
  join(unit.mean[0], unit.mean[1]);
  for (std::size_t i = 0; i < unit.torque[0].size(); ++i) join(unit.torque[0][i], unit.torque[1][i]);
  return unit;
}

std::vector<double> lagged(const LoadRecord& r, const UnitTorque& unit, std::size_t u, double time_constant) {
  std::vector<double> out(r.voltage.size(), 0.0);
  Lag lag(time_constant);
  if (r.starts_in_cut) lag.start(unit.mean[u]);
  double before = unit.at_engagement[u];
  for (std::size_t i = 0; i < unit.torque[u].size(); ++i) {
    const double now = unit.torque[u][i];
    // Engagement is a step between samples.
    out[r.first + i] = lag.step(before, now, i == 0 ? r.lead : r.dt);
    before = now;
  }
  return out;
}

// Ratio of the mean torque with runout to that without, for Ktc and Kte.
std::array<double, 2> meanShare(const LoadRecord& r, const Runout& runout) {
  const std::array<double, 2> plain = RunoutTorque(r.tool, r.engagement, 0.0, 0.0).mean(),
                              with = RunoutTorque(r.tool, r.engagement, runout.x, runout.y).mean();
  return {with[0] / plain[0], with[1] / plain[1]};
}

// Derivative of the response with respect to the offset in x or y.
std::vector<double> runoutResponse(const LoadRecord& r, const LoadPoint& about, std::size_t axis) {
  const double d = 2e-7;
  const auto torqueAt = [&](double step) {
    Runout at = about.runout;
    (axis == 0 ? at.x : at.y) += step;
    return weighted(unitTorque(r, at, 1024), about, 0.5 / d);
  };
  UnitTorque sum = torqueAt(d);
  const UnitTorque below = torqueAt(-d);
  sum.at_engagement[0] -= below.at_engagement[0];
  sum.mean[0] -= below.mean[0];
  for (std::size_t i = 0; i < sum.torque[0].size(); ++i) sum.torque[0][i] -= below.torque[0][i];
  return lagged(r, sum, 0, about.time_constant);
}

// Torque of each column of a cut per sample; empty where the record has no such response.
std::array<std::vector<double>, LOAD_COLUMNS> responses(LoadRecord& r, const LoadPoint& about) {
  std::array<std::vector<double>, LOAD_COLUMNS> by;
  by[IDLE].assign(r.voltage.size(), 1.0);
  if (!r.cut) return by;
  const UnitTorque here = unitTorque(r, r.has_angle ? about.runout : Runout(), 4096);
  by[KTC] = lagged(r, here, 0, about.time_constant);
  by[KTE] = lagged(r, here, 1, about.time_constant);
  // The lag is linear, so that the weighted torques are summed before it.
  const UnitTorque sum = weighted(here, about, 1.0);
  const double h = 1e-3;
  by[LAG] = lagged(r, sum, 0, about.time_constant * (1.0 + h));
  const std::vector<double> faster = lagged(r, sum, 0, about.time_constant * (1.0 - h));
  for (std::size_t i = 0; i < faster.size(); ++i) by[LAG][i] = (by[LAG][i] - faster[i]) / (2.0 * h);
  if (r.has_angle && r.tool.teeth > 1) {
    by[RUNOUT_X] = runoutResponse(r, about, 0);
    by[RUNOUT_Y] = runoutResponse(r, about, 1);
  } else if (about.runout.x != 0.0 || about.runout.y != 0.0) {
    r.mean_ratio = meanShare(r, about.runout);
  }
  return by;
}

// Number of harmonics of a revolution; the lag suppresses higher ones.
std::size_t harmonicsOf(const ToolGeometry& tool) {
  return 3 * static_cast<std::size_t>(tool.teeth);
}

bool isSparse(const LoadRecord& r, double interval) {
  return 2.0 * r.tool.teeth * r.speed * interval > units::TWO_PI;
}

// Number of independent samples behind the lag.
double differentSamples(double samples, double interval, double time_constant) {
  const double alike = std::exp(-interval / time_constant);
  return samples * (1.0 - alike) / (1.0 + alike);
}

// Evenly spaced readings alias a harmonic to zero frequency when its period divides their interval. Random
// times leave 1 / n, which the scatter contains already.
std::vector<double> aliasedShares(const LoadRecord& r, const std::vector<double>& times) {
  const double n = static_cast<double>(times.size());
  std::vector<double> shares;
  for (std::size_t k = 1; k <= harmonicsOf(r.tool); ++k) {
    std::complex<double> sum = 0.0;
    for (const double t : times) sum += std::polar(1.0 / n, static_cast<double>(k) * r.speed * t);
    shares.push_back(std::max(0.0, std::norm(sum) - 1.0 / n));
  }
  return shares;
}

}  // namespace

const LoadRow& loadUnits() {
  static const LoadRow UNITS = (LoadRow() << 1.0, 1e9, 1e4, 1.0, 1e-5, 1e-5).finished();
  return UNITS;
}

LoadRecord loadRecord(const CampaignTest& test, const Record& record, const ToolGeometry& tool) {
  LoadRecord r;
  r.speed = test.spindle_speed;
  r.start_time = test.start_time.value_or(0.0);
  r.cut = test.kind == TestKind::cut;
  r.voltage = record.column("load_meter");
  r.dt = 1.0 / test.sample_rate;
  r.tool = tool;
  r.sparse = isSparse(r, r.dt);
  if (!r.cut) return r;
  const double begin = record.time.front(), engage = test.engage_time.value_or(0.0);
  r.starts_in_cut = !test.engage_time;
  r.first = std::min(record.size(), static_cast<std::size_t>(std::ceil(engage / r.dt - 1e-9)));
  r.lead = static_cast<double>(r.first) * r.dt - engage;
  r.in_cut = 1.0 - static_cast<double>(r.first) / static_cast<double>(record.size());
  r.edge_age =
      test.cut_time_before.value_or(0.0) + 0.5 * (static_cast<double>(record.size()) * r.dt - engage);
  r.engagement = *test.engagement;
  r.has_angle = record.has("spindle_angle");
  if (!r.has_angle || r.first >= record.size()) return r;
  const std::vector<double>& angle = record.column("spindle_angle");
  r.engage_angle = angle[r.first] + r.speed * (begin + engage - record.time[r.first]);
  r.angle.assign(angle.begin() + static_cast<std::ptrdiff_t>(r.first), angle.end());
  return r;
}

LoadRecord loadRecord(const LoadTest& test, bool cut, const Spindle& spindle, double noise,
                      double first_stamp, double edge_age) {
  LoadRecord r;
  r.speed = test.speed;
  r.start_time = test.stamp - first_stamp;
  r.edge_age = edge_age;
  r.cut = cut;
  r.tool = test.condition.tool;
  r.engagement = test.condition.engagement;
  const double watt = spindle.load_meter_gain * r.speed;
  r.rows = Eigen::MatrixXd::Zero(1, LOAD_COLUMNS);
  r.rows(0, IDLE) = watt * loadUnits()[IDLE];
  if (r.cut) {
    const std::array<double, 2> mean = RunoutTorque(r.tool, r.engagement, 0.0, 0.0).mean();
    r.rows(0, KTC) = watt * mean[0] * loadUnits()[KTC];
    r.rows(0, KTE) = watt * mean[1] * loadUnits()[KTE];
  }
  r.target = Eigen::VectorXd::Constant(1, test.voltage.mean);
  r.spread = test.torqueStdAsVoltage() / noise;
  r.variance = test.variance();
  if (test.voltages.size() < 2) return r;
  const double n = static_cast<double>(test.voltages.size());
  r.sparse = isSparse(r, test.duration / (n - 1.0));
  r.samples = differentSamples(n, test.duration / (n - 1.0), timeConstant(spindle.load_meter_bandwidth));
  if (r.cut && r.sparse) r.aliased_share = aliasedShares(r, test.times);
  return r;
}

void LoadRecord::condense(const Spindle& spindle, const LoadPoint& about) {
  if (voltage.empty()) return;
  const double watt = spindle.load_meter_gain * speed, resolution = spindle.load_meter_resolution;
  const std::array<std::vector<double>, LOAD_COLUMNS> by = responses(*this, about);
  Square normal = Square::Zero();
  LoadRow right = LoadRow::Zero(), row = LoadRow::Zero();
  sum.setZero();
  double squares = 0.0;
  for (std::size_t i = 0; i < voltage.size(); ++i) {
    for (std::size_t c = 0; c < LOAD_COLUMNS; ++c) {
      const Eigen::Index at = static_cast<Eigen::Index>(c);
      if (!by[c].empty()) row[at] = watt * by[c][i] * loadUnits()[at];
    }
    normal += row * row.transpose();
    right += row * voltage[i];
    sum += row;
    squares += voltage[i] * voltage[i];
  }
  const linear::SymmetricEigensystem own = linear::symmetricEigensystem(normal);
  const double largest = own.values.maxCoeff();
  std::vector<int> kept;
  for (int k = 0; k < LOAD_COLUMNS; ++k) {
    if (own.values[k] > 1e-11 * largest) kept.push_back(k);
  }
  rows.resize(static_cast<Eigen::Index>(kept.size()), LOAD_COLUMNS);
  target.resize(static_cast<Eigen::Index>(kept.size()));
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const Eigen::Index at = static_cast<Eigen::Index>(i);
    const double root = std::sqrt(own.values[kept[i]]);
    rows.row(at) = root * own.vectors.col(kept[i]).transpose();
    target[at] = own.vectors.col(kept[i]).dot(right) / root;
  }
  residual_squares = std::max(0.0, squares - target.squaredNorm());
  variance = residual_squares / static_cast<double>(voltage.size());
  samples = differentSamples(static_cast<double>(voltage.size()), dt, about.time_constant);
  // Rounding shifts a level by up to half a step unless noise, or a cut's own response, spreads the readings
  // over the steps.
  const double step = resolution / std::sqrt(12.0);
  const auto [low, high] = std::minmax_element(voltage.begin(), voltage.end());
  const bool swept = *high - *low > 1.5 * resolution;
  const double noise2 = swept ? std::max(0.0, variance - step * step) : 0.0;
  rounding = step * std::exp(-2.0 * units::PI * units::PI * noise2 / (resolution * resolution));
}

RunoutEffect::RunoutEffect(const LoadRecord& record, const Spindle& spindle, double time_constant,
                           double largest)
    : largest_(largest), nodes_(NODES) {
  const std::size_t highest = harmonicsOf(record.tool), steps = 8 * highest;
  const double n = static_cast<double>(steps), pitch = units::TWO_PI / record.tool.teeth;
  const double watt = spindle.load_meter_gain * record.speed;
  const std::array<double, 2> plain = RunoutTorque(record.tool, record.engagement, 0.0, 0.0).mean();
  for (std::size_t i = 0; i < NODES; ++i) {
    const double offset = largest * static_cast<double>(i) / (NODES - 1);
    for (std::size_t a = 0; a < ANGLES; ++a) {
      const double angle = pitch * (static_cast<double>(a) + 0.5) / ANGLES;
      const RunoutTorque torque(record.tool, record.engagement, offset * std::cos(angle),
                                offset * std::sin(angle));
      Node& node = nodes_[i][a];
      node.mean_ratio = {torque.mean()[0] / plain[0], torque.mean()[1] / plain[1]};
      node.harmonics.assign(highest, {});
      for (std::size_t s = 0; s < steps; ++s) {
        const double turn = units::TWO_PI * static_cast<double>(s) / n;
        const std::array<double, 2> here = torque.at(turn);
        for (std::size_t k = 1; k <= highest; ++k) {
          const double order = static_cast<double>(k);
          // First-order lag; the amplitude is twice the Fourier coefficient.
          const std::complex<double> turned = std::polar(2.0 * watt / n, -order * turn) /
                                              std::complex<double>(1.0, order * record.speed * time_constant);
          for (std::size_t u = 0; u < 2; ++u) node.harmonics[k - 1][u] += turned * here[u];
        }
      }
    }
  }
}

double RunoutEffect::at(double offset, std::size_t* node) const {
  const double x = std::clamp(offset / largest_, 0.0, 1.0) * (NODES - 1);
  *node = std::min(static_cast<std::size_t>(x), NODES - 2);
  return x - static_cast<double>(*node);
}

std::array<double, 2> RunoutEffect::meanRatio(double offset, std::size_t angle) const {
  std::size_t node = 0;
  const double beyond = at(offset, &node);
  const std::array<double, 2>&low = nodes_[node][angle].mean_ratio,
                           &high = nodes_[node + 1][angle].mean_ratio;
  return {low[0] + beyond * (high[0] - low[0]), low[1] + beyond * (high[1] - low[1])};
}

std::array<double, 2> RunoutEffect::meanRatio(double offset) const {
  std::array<double, 2> mean{{0.0, 0.0}};
  for (std::size_t a = 0; a < ANGLES; ++a) {
    const std::array<double, 2> one = meanRatio(offset, a);
    for (std::size_t u = 0; u < 2; ++u) mean[u] += one[u] / ANGLES;
  }
  return mean;
}

// Squared amplitude of each harmonic [V2].
std::vector<double> RunoutEffect::power(double offset, std::size_t angle, double ktc, double kte) const {
  std::size_t node = 0;
  const double beyond = at(offset, &node);
  const auto &low = nodes_[node][angle].harmonics, &high = nodes_[node + 1][angle].harmonics;
  std::vector<double> power;
  for (std::size_t k = 0; k < low.size(); ++k) {
    const std::complex<double> tc = low[k][0] + beyond * (high[k][0] - low[k][0]),
                               te = low[k][1] + beyond * (high[k][1] - low[k][1]);
    power.push_back(std::norm(ktc * tc + kte * te));
  }
  return power;
}

RunoutEffect::Variance RunoutEffect::variance(double offset, std::size_t angle, double ktc,
                                              double kte) const {
  double sum2 = 0.0, sum4 = 0.0;
  for (const double p : power(offset, angle, ktc, kte)) {
    sum2 += p;
    sum4 += p * p;
  }
  // Aliased harmonics add as phasors: |sum|^2 / 2, whose cross terms have this RMS.
  return {0.5 * sum2, 0.5 * std::sqrt(std::max(0.0, sum2 * sum2 - sum4))};
}

double RunoutEffect::aliasedVariance(double offset, double ktc, double kte,
                                     const std::vector<double>& aliased_share) const {
  double variance = 0.0;
  for (std::size_t a = 0; a < ANGLES; ++a) {
    const std::vector<double> p = power(offset, a, ktc, kte);
    for (std::size_t k = 0; k < aliased_share.size(); ++k) variance += 0.5 * aliased_share[k] * p[k] / ANGLES;
  }
  return variance;
}

}  // namespace smartmill::loadmeter
