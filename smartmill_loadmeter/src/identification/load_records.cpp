// Ktc and Kte from load-meter records: campaign_identification.h.
#include <algorithm>
#include <cmath>
#include <set>

#include <Eigen/Dense>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"
#include "smartmill_loadmeter/identification/runout_torque.h"

namespace smartmill::loadmeter {

namespace {

// Columns of a record, in units of a typical value: idle torque, Ktc, Kte, log of the time constant, runout
// x, y.
constexpr int COLUMNS = 6;
enum Column { IDLE, KTC, KTE, LAG, RUNOUT_X, RUNOUT_Y };
using Row = Eigen::Matrix<double, COLUMNS, 1>;
using Square = Eigen::Matrix<double, COLUMNS, COLUMNS>;
const Row UNIT = (Row() << 1.0, 1e9, 1e4, 1.0, 1e-5, 1e-5).finished();

/// Offset of the cutter axis [m], towards tooth 1 and across.
struct Runout {
  double x = 0.0, y = 0.0;
};

// One first-order lag, exact for an input that runs linearly within a step.
class Lag {
 public:
  explicit Lag(double time_constant) : time_constant_(time_constant) {}
  void start(double value) { output_ = value; }
  double step(double from, double to, double dt) {
    if (dt != dt_) keep_ = std::exp(-dt / time_constant_), dt_ = dt;
    const double a = keep_, slope = dt > 0.0 ? (to - from) / dt : 0.0;
    output_ = a * output_ + (1.0 - a) * (from - slope * time_constant_) + slope * dt;
    return output_;
  }

 private:
  double time_constant_;
  double output_ = 0.0, dt_ = 0.0, keep_ = 1.0;
};

/// One air cut or cut and its torque for Ktc = 1 and Kte = 1.
struct LoadRecord {
  std::string name;
  double speed = 0.0;       // [rad/s]
  double start_time = 0.0;  // [s]
  double edge_age = 0.0;    // [s] cutting time of the edge in the middle of the cut
  bool cut = false;
  std::vector<double> voltage;  // [V]
  std::size_t first = 0;        // sample at or after engagement
  double dt = 0.0, lead = 0.0;  // [s] sample interval; engagement before sample `first`
  bool throughout = false;      // in cut before the record began
  ToolGeometry tool;
  Engagement engagement;
  bool has_angle = false;
  double engage_angle = 0.0;  // [rad] of the spindle
  std::vector<double> angle;  // [rad] from `first` on
  // Without the angle runout acts through the mean alone: share of it, per Ktc and Kte.
  std::array<double, 2> share{{1.0, 1.0}};

  // Condensed: V = watt (columns x quantities).
  Square normal;
  Row right;
  double squares = 0.0;
  Row sum;  // of the rows: what a constant error of the voltage does
  Eigen::MatrixXd rows;
  Eigen::VectorXd target;
  double saturated = 0.0;  // [V2] squares left by the record's own best fit
  double rounding = 0.0;   // [V] of its level
};

LoadRecord prepare(const CampaignTest& test, const Record& record, const ToolGeometry& tool) {
  LoadRecord r;
  r.name = test.name;
  r.speed = test.spindle_speed;
  r.start_time = test.start_time.value_or(0.0);
  r.cut = test.kind == TestKind::cut;
  r.voltage = record.column("load_meter");
  r.dt = 1.0 / test.sample_rate;
  if (!r.cut) return r;
  const double begin = record.time.front(), engage = test.engage_time.value_or(0.0);
  r.throughout = !test.engage_time;
  r.first = std::min(record.size(), static_cast<std::size_t>(std::ceil(engage / r.dt - 1e-9)));
  r.lead = static_cast<double>(r.first) * r.dt - engage;
  r.edge_age =
      test.cut_time_before.value_or(0.0) + 0.5 * (static_cast<double>(record.size()) * r.dt - engage);
  r.tool = tool;
  r.engagement = *test.engagement;
  r.has_angle = record.has("spindle_angle");
  if (!r.has_angle || r.first >= record.size()) return r;
  const std::vector<double>& angle = record.column("spindle_angle");
  r.engage_angle = angle[r.first] + r.speed * (begin + engage - record.time[r.first]);
  r.angle.assign(angle.begin() + static_cast<std::ptrdiff_t>(r.first), angle.end());
  return r;
}

// Torque in cut per unit of Ktc, Kte: at engagement, in the mean, from `first` on.
struct UnitTorque {
  std::array<double, 2> at_engagement, mean;
  std::array<std::vector<double>, 2> torque;
};

// Without the angle: the mean. @param steps of a revolution, linear between them.
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
    const double share = at - static_cast<double>(k);
    for (std::size_t u = 0; u < 2; ++u) {
      unit.torque[u][i] = table[k][u] + share * (table[k + 1][u] - table[k][u]);
    }
  }
  unit.at_engagement = torque.at(r.engage_angle);
  return unit;
}

// Both torques as one, in place of the first.
UnitTorque weighted(UnitTorque unit, const std::array<double, 2>& k, double factor) {
  const auto join = [&](double& first, double second) { first = factor * (k[0] * first + k[1] * second); };
  join(unit.at_engagement[0], unit.at_engagement[1]);
  join(unit.mean[0], unit.mean[1]);
  for (std::size_t i = 0; i < unit.torque[0].size(); ++i) join(unit.torque[0][i], unit.torque[1][i]);
  return unit;
}

std::vector<double> lagged(const LoadRecord& r, const UnitTorque& unit, std::size_t u, double time_constant) {
  std::vector<double> out(r.voltage.size(), 0.0);
  Lag lag(time_constant);
  if (r.throughout) lag.start(unit.mean[u]);
  double before = unit.at_engagement[u];
  for (std::size_t i = 0; i < unit.torque[u].size(); ++i) {
    const double now = unit.torque[u][i];
    // Engagement is a step that need not fall on a sample.
    out[r.first + i] = lag.step(before, now, i == 0 ? r.lead : r.dt);
    before = now;
  }
  return out;
}

// Mean torque with runout over that without, per Ktc and Kte.
std::array<double, 2> meanShare(const LoadRecord& r, const Runout& runout) {
  const std::array<double, 2> plain = RunoutTorque(r.tool, r.engagement, 0.0, 0.0).mean(),
                              with = RunoutTorque(r.tool, r.engagement, runout.x, runout.y).mean();
  return {with[0] / plain[0], with[1] / plain[1]};
}

/// @param ktc, kte [N/m2], [N/m] about which the columns of the lag and the runout are taken.
/// @param runout [m] likewise. @param resolution [V].
void condense(LoadRecord& r, double gain, double time_constant, double ktc, double kte, const Runout& runout,
              double resolution) {
  const double watt = gain * r.speed;
  r.normal.setZero();
  r.right.setZero();
  r.sum.setZero();
  r.squares = 0.0;
  std::array<std::vector<double>, 2> unit;
  std::array<std::vector<double>, 3> by;  // lag, runout x, y
  if (r.cut) {
    const std::array<double, 2> k{ktc, kte};
    for (std::vector<double>& column : by) column.assign(r.voltage.size(), 0.0);
    const UnitTorque here = unitTorque(r, r.has_angle ? runout : Runout(), 4096);
    for (std::size_t u = 0; u < 2; ++u) unit[u] = lagged(r, here, u, time_constant);
    // What is weighted may be summed before the lag, which is linear.
    UnitTorque sum = weighted(here, k, 1.0);
    const double h = 1e-3, d = 2e-7;
    const std::vector<double> slower = lagged(r, sum, 0, time_constant * (1.0 + h)),
                              faster = lagged(r, sum, 0, time_constant * (1.0 - h));
    for (std::size_t i = 0; i < by[0].size(); ++i) by[0][i] = (slower[i] - faster[i]) / (2.0 * h);
    if (r.has_angle && r.tool.teeth > 1) {
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const Runout step = axis == 0 ? Runout{d, 0.0} : Runout{0.0, d};
        sum = weighted(unitTorque(r, {runout.x + step.x, runout.y + step.y}, 1024), k, 0.5 / d);
        const UnitTorque below =
            weighted(unitTorque(r, {runout.x - step.x, runout.y - step.y}, 1024), k, 0.5 / d);
        sum.at_engagement[0] -= below.at_engagement[0];
        sum.mean[0] -= below.mean[0];
        for (std::size_t i = 0; i < sum.torque[0].size(); ++i) sum.torque[0][i] -= below.torque[0][i];
        by[1 + axis] = lagged(r, sum, 0, time_constant);
      }
    } else {
      r.share = meanShare(r, runout);
    }
  }
  Row row = Row::Zero();
  row[IDLE] = watt * UNIT[IDLE];
  for (std::size_t i = 0; i < r.voltage.size(); ++i) {
    if (r.cut) {
      row[KTC] = watt * unit[0][i] * UNIT[KTC];
      row[KTE] = watt * unit[1][i] * UNIT[KTE];
      for (std::size_t c = 0; c < 3; ++c) {
        const Eigen::Index at = static_cast<Eigen::Index>(LAG + c);
        row[at] = watt * by[c][i] * UNIT[at];
      }
    }
    r.normal += row * row.transpose();
    r.right += row * r.voltage[i];
    r.sum += row;
    r.squares += r.voltage[i] * r.voltage[i];
  }
  const Eigen::SelfAdjointEigenSolver<Square> solver(r.normal);
  const double largest = solver.eigenvalues().maxCoeff();
  std::vector<int> kept;
  for (int k = 0; k < COLUMNS; ++k) {
    if (solver.eigenvalues()[k] > 1e-11 * largest) kept.push_back(k);
  }
  r.rows.resize(static_cast<Eigen::Index>(kept.size()), COLUMNS);
  r.target.resize(static_cast<Eigen::Index>(kept.size()));
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const Eigen::Index at = static_cast<Eigen::Index>(i);
    const double root = std::sqrt(solver.eigenvalues()[kept[i]]);
    r.rows.row(at) = root * solver.eigenvectors().col(kept[i]).transpose();
    r.target[at] = solver.eigenvectors().col(kept[i]).dot(r.right) / root;
  }
  r.saturated = std::max(0.0, r.squares - r.target.squaredNorm());
  // Rounding moves a level by up to half a step where no noise spreads the readings over the steps. A cut's
  // own response sweeps the steps.
  const double step = resolution / std::sqrt(12.0);
  const double variance = r.saturated / static_cast<double>(r.voltage.size());
  const auto [low, high] = std::minmax_element(r.voltage.begin(), r.voltage.end());
  const bool spread = *high - *low > 1.5 * resolution;
  const double noise2 = spread ? std::max(0.0, variance - step * step) : 0.0;
  r.rounding = step * std::exp(-2.0 * units::PI * units::PI * noise2 / (resolution * resolution));
}

/// Which unknowns take part beyond viscous, coulomb, Ktc, Kte.
struct Terms {
  FrictionShape friction;
  bool growth = false, runout = false, lag = false;
  std::size_t count() const {
    return friction.unknowns() + 2 + (growth ? 1 : 0) + (runout ? 2 : 0) + (lag ? 1 : 0);
  }
};

// Neither a machine nor an integrator follows the model more closely: what the records disagree by below this
// share of their voltage widens the standard deviations but is no reason to look for a cause.
constexpr double MODEL_SHARE = 2e-4;

struct Prior {
  std::size_t unknown;
  double value, std_dev;
};

struct Solution {
  Terms terms;
  FitResult fit;
  std::size_t residuals = 0;
  double bic = 0.0, misfit = 0.0;
  double share = 0.0;  // [1] RMS of what the records disagree by, of the RMS of their voltages
};

class Campaigns {
 public:
  std::vector<LoadRecord> records;
  double noise = 0.0;       // [V]
  double zero_below = 0.0;  // [rad/s]
  double slowest = 0.0, fastest = 0.0;
  std::vector<Prior> friction_priors;
  double runout_prior = 0.0;  // [m] of each component; 0: none
  Runout runout_at;           // of the condensed records
  double lag_prior = 0.0;     // std of the log time constant; 0: none
  double lag_at = 0.0;        // log of (time constant of the condensed records / the model's)

  std::size_t ktcAt(const Terms& t) const { return t.friction.unknowns(); }

  std::size_t residualCount() const {
    std::size_t n = friction_priors.size() + (lag_prior > 0.0 ? 1 : 0) + (runout_prior > 0.0 ? 2 : 0);
    for (const LoadRecord& r : records) n += static_cast<std::size_t>(r.target.size());
    return n;
  }

  void residuals(const Terms& terms, const std::vector<double>& v, double* out) const {
    const FrictionLaw law = FrictionLaw::fromValues(terms.friction, v.data(), zero_below);
    std::size_t at = ktcAt(terms);
    const double ktc = v[at++], kte = v[at++];
    const double growth = terms.growth ? v[at++] : 0.0;
    const Runout runout = terms.runout ? Runout{v[at], v[at + 1]} : Runout();
    if (terms.runout) at += 2;
    const double log_lag = terms.lag ? v[at++] : lag_at;
    for (const LoadRecord& r : records) {
      Row quantity = Row::Zero();
      quantity[IDLE] = law.torque(r.speed, r.start_time);
      if (r.cut) {
        quantity[KTC] = ktc * r.share[0];
        quantity[KTE] = kte * (1.0 + growth * r.edge_age) * r.share[1];
        quantity[LAG] = log_lag - lag_at;
        quantity[RUNOUT_X] = runout.x - runout_at.x;
        quantity[RUNOUT_Y] = runout.y - runout_at.y;
      }
      const Eigen::VectorXd rest = (r.rows * quantity.cwiseQuotient(UNIT) - r.target) / noise;
      for (Eigen::Index i = 0; i < rest.size(); ++i) *out++ = rest[i];
    }
    for (const Prior& p : friction_priors) *out++ = (v[p.unknown] - p.value) / p.std_dev;
    if (runout_prior > 0.0) {
      *out++ = runout.x / runout_prior;
      *out++ = runout.y / runout_prior;
    }
    if (lag_prior > 0.0) *out++ = log_lag / lag_prior;
  }

  Solution solve(const Terms& terms, const FrictionLaw& start, double ktc, double kte) const {
    std::vector<FitParameter> unknowns = FrictionLaw::parameters(terms.friction, slowest, fastest, start);
    unknowns.push_back({ktc, -1e12, 1e12, 1e9});
    unknowns.push_back({kte, -1e8, 1e8, 1e4});
    if (terms.growth) unknowns.push_back({0.0, -0.1, 1.0, 0.01});
    if (terms.runout) {
      unknowns.push_back({runout_at.x, -1e-4, 1e-4, 1e-5});
      unknowns.push_back({runout_at.y, -1e-4, 1e-4, 1e-5});
    }
    if (terms.lag) unknowns.push_back({lag_at, -3.0, 3.0, 0.1});
    Solution s;
    s.terms = terms;
    s.residuals = residualCount();
    s.fit = loadmeter::fit([&](const std::vector<double>& v, double* out) { residuals(terms, v, out); },
                           s.residuals, unknowns);
    const double freedom = static_cast<double>(s.residuals) - static_cast<double>(terms.count());
    s.misfit = s.fit.squares / std::max(1.0, freedom);
    double size2 = 0.0;
    for (const LoadRecord& r : records) size2 += r.target.squaredNorm();
    s.share = noise * std::sqrt(s.fit.squares / size2);
    s.bic = informationCriterion(s.fit.squares * noise * noise, s.residuals, terms.count(), false);
    return s;
  }
};

/// Coefficients averaged over what the runout may be.
struct RunoutAverage {
  double ktc = 0.0, kte = 0.0;
  double variance_tc = 0.0, variance_te = 0.0,
         covariance = 0.0;  // between the offsets, beside each one's own
};

// Where teeth miss part of their arc runout only ever takes away edge: an offset of zero is no middle, so
// each offset has its own fit, weighted by how well the records go with it.
RunoutAverage averageOverRunout(Campaigns all, const Solution& chosen, double largest,
                                const ToolGeometry& tool) {
  constexpr int OFFSETS = 6, ANGLES = 4;
  const std::size_t at = all.ktcAt(chosen.terms);
  const FrictionLaw start =
      FrictionLaw::fromValues(chosen.terms.friction, chosen.fit.value.data(), all.zero_below);
  struct Point {
    double ktc, kte, squares;
  };
  std::vector<Point> points;
  double least = std::numeric_limits<double>::infinity(), misfit = 1.0;
  for (int o = 0; o < OFFSETS; ++o) {
    for (int a = 0; a < ANGLES; ++a) {
      const double offset = largest * (o + 0.5) / OFFSETS;
      const double angle = units::TWO_PI / tool.teeth * (a + 0.5) / ANGLES;
      for (LoadRecord& r : all.records) {
        if (r.cut) r.share = meanShare(r, {offset * std::cos(angle), offset * std::sin(angle)});
      }
      const Solution s = all.solve(chosen.terms, start, chosen.fit.value[at], chosen.fit.value[at + 1]);
      points.push_back({s.fit.value[at], s.fit.value[at + 1], s.fit.squares});
      if (s.fit.squares < least) least = s.fit.squares, misfit = std::max(1.0, s.misfit);
    }
  }
  RunoutAverage average;
  double sum = 0.0;
  const auto weight = [&](const Point& p) { return std::exp(-0.5 * (p.squares - least) / misfit); };
  for (const Point& p : points) {
    sum += weight(p);
    average.ktc += weight(p) * p.ktc;
    average.kte += weight(p) * p.kte;
  }
  average.ktc /= sum;
  average.kte /= sum;
  for (const Point& p : points) {
    const double c = p.ktc - average.ktc, e = p.kte - average.kte, w = weight(p) / sum;
    average.variance_tc += w * c * c;
    average.variance_te += w * e * e;
    average.covariance += w * c * e;
  }
  return average;
}

}  // namespace

LoadRecordResult identifyFromLoadRecords(const Campaign& campaign, const MachineModel& model,
                                         const LoadRecordOptions& options) {
  std::vector<TestRecord> tests;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::tap) tests.push_back({test, readRecord(campaign, test)});
  }
  return identifyFromLoadRecords(tests, model, options, campaign.folder);
}

LoadRecordResult identifyFromLoadRecords(const std::vector<TestRecord>& tests, const MachineModel& model,
                                         const LoadRecordOptions& options, const std::string& where) {
  const Spindle& spindle = model.needSpindle("read the load meter");
  const ToolGeometry& tool = model.needTool("identify cutting coefficients");
  const double stated = model.uncertainty.spindle / 100.0;
  LoadRecordResult result;
  Campaigns all;
  all.zero_below = spindle.friction_zero_below;
  std::set<double> air_speeds;
  std::set<long> chips;
  int cuts = 0, airs = 0;
  for (const auto& [test, record] : tests) {
    if (!record.has("load_meter")) {
      result.notes.push_back(record.file + ": no load_meter column, left out");
      continue;
    }
    all.records.push_back(prepare(test, record, tool));
    if (test.kind == TestKind::cut) {
      const auto map = meanForceMatrix(tool, *test.engagement);
      chips.insert(std::lround(1e9 * map[3][0] / map[3][3]));
      ++cuts;
    } else {
      ++airs;
      if (test.spindle_speed >= spindle.friction_zero_below) air_speeds.insert(test.spindle_speed);
    }
  }
  if (airs > 0 && air_speeds.size() < 2) {
    throw Error(where + ": friction: air cuts at two or more speeds are due, " +
                std::to_string(air_speeds.size()) + " usable");
  }
  if (chips.size() < 3) {
    throw Error(where + ": coefficients from torque: " + std::to_string(cuts) + " cuts at " +
                std::to_string(chips.size()) + " different feeds; at least three are due");
  }
  all.slowest = all.fastest = all.records.front().speed;
  bool timed = true;
  double samples = 0.0;
  std::set<double> ages;
  for (const LoadRecord& r : all.records) {
    all.slowest = std::min(all.slowest, r.speed);
    all.fastest = std::max(all.fastest, r.speed);
    if (r.cut) ages.insert(r.edge_age);
    samples += static_cast<double>(r.voltage.size());
  }
  for (const TestRecord& t : tests) timed = timed && t.test.start_time;
  if (airs == 0) {
    // What the model believes is one observation of each friction term.
    const Friction known = modelFriction(spindle, model.uncertainty.spindle);
    const double smallest = 1e-6 * (std::abs(known.coulomb) + known.viscous * all.fastest) + 1e-12;
    all.friction_priors = {{0, known.viscous, std::sqrt(known.covariance[0]) + smallest / all.fastest},
                           {1, known.coulomb, std::sqrt(known.covariance[3]) + smallest}};
  }
  // With the angle a tooth's own share shows in the ripple; without it runout is averaged over, further
  // below.
  const bool ripple = std::any_of(all.records.begin(), all.records.end(),
                                  [](const LoadRecord& r) { return r.has_angle && r.tool.teeth > 1; });
  if (ripple) all.runout_prior = options.runout_uncertainty / std::sqrt(2.0);
  if (options.spindle_uncertainty) all.lag_prior = std::max(stated, 1e-6);

  const double nominal_lag = timeConstant(spindle.load_meter_bandwidth);
  FrictionLaw start;
  start.viscous = spindle.viscous;
  start.coulomb = spindle.coulomb;
  start.stribeck_speed = 0.15 * all.fastest;
  double ktc = 1e9, kte = 1e4, growth = 0.0;
  const auto condenseAll = [&] {
    double left = 0.0, freedom = samples;
    for (LoadRecord& r : all.records) {
      condense(r, spindle.load_meter_gain, nominal_lag * std::exp(all.lag_at), ktc,
               kte * (1.0 + growth * r.edge_age), all.runout_at, spindle.load_meter_resolution);
      left += r.saturated;
      freedom -= static_cast<double>(r.target.size());
    }
    // The rounding's own spread is a floor: a record without noise does not stand for an exact reading.
    all.noise = std::max(std::sqrt(left / freedom), 0.1 * spindle.load_meter_resolution / std::sqrt(12.0));
  };
  // Again about what was found: the columns of lag and runout hang on the coefficients, and on themselves.
  const auto settle = [&](const Terms& terms) {
    Solution s;
    for (int pass = 0; pass < (terms.runout ? 6 : terms.lag ? 4 : 2); ++pass) {
      condenseAll();
      s = all.solve(terms, start, ktc, kte);
      std::size_t at = all.ktcAt(terms);
      ktc = s.fit.value[at++];
      kte = s.fit.value[at++];
      growth = terms.growth ? s.fit.value[at++] : 0.0;
      if (terms.runout) all.runout_at = {s.fit.value[at], s.fit.value[at + 1]};
      if (terms.lag) all.lag_at = s.fit.value.back();
      start = FrictionLaw::fromValues(terms.friction, s.fit.value.data(), all.zero_below);
    }
    return s;
  };

  Terms terms;
  terms.lag = options.spindle_uncertainty;
  terms.runout = all.runout_prior > 0.0;
  Solution chosen = settle(terms);
  // Terms are added while the records disagree by more than chance would (chi2 per degree of freedom of some
  // forty: 1.6 has a probability below 1 %), each one that the evidence favours by more than ten.
  while (options.choose_terms && chosen.misfit > 1.6 && chosen.share > MODEL_SHARE) {
    const double chosen_noise = all.noise;
    std::vector<Terms> tries;
    const auto with = [&](auto change) {
      Terms t = chosen.terms;
      change(t);
      if (t.count() + 2 <= chosen.residuals) tries.push_back(t);
    };
    if (!chosen.terms.friction.stribeck && air_speeds.size() >= 4) {
      with([](Terms& t) { t.friction.stribeck = true; });
    }
    if (!chosen.terms.friction.warmup && timed) with([](Terms& t) { t.friction.warmup = true; });
    if (!chosen.terms.growth && ages.size() >= 3) with([](Terms& t) { t.growth = true; });
    if (!chosen.terms.lag) with([](Terms& t) { t.lag = true; });
    std::optional<Solution> best;
    for (const Terms& t : tries) {
      for (const double share : {0.1, 0.25}) {
        for (const double constant : {150.0, 600.0, 2400.0}) {
          FrictionLaw from = start;
          if (!chosen.terms.friction.stribeck)
            from.stribeck_speed = std::max(share * all.fastest, all.slowest);
          if (!chosen.terms.friction.warmup) from.warmup_time = constant;
          const Solution s = all.solve(t, from, ktc, kte);
          if (!best || s.bic < best->bic) best = s;
          if (!t.friction.warmup || chosen.terms.friction.warmup) break;
        }
        if (!t.friction.stribeck || chosen.terms.friction.stribeck) break;
      }
    }
    double best_noise = all.noise;
    if (!chosen.terms.runout && ripple) {
      // Runout changes the shape of the responses: condensed anew about what it finds.
      Terms t = chosen.terms;
      t.runout = true;
      const Campaigns before = all;
      const FrictionLaw start_before = start;
      const std::array<double, 3> k_before{ktc, kte, growth};
      const Solution s = settle(t);
      if (!best || s.bic < best->bic) {
        best = s;
        best_noise = all.noise;
      } else {
        all = before;
        start = start_before;
        ktc = k_before[0], kte = k_before[1], growth = k_before[2];
      }
    }
    // Half of the disagreement must go with it: a wrong cause always takes up some.
    const auto volts2 = [](const Solution& s, double noise) { return s.fit.squares * noise * noise; };
    if (!best || best->bic > chosen.bic - 10.0 ||
        volts2(*best, best_noise) > 0.5 * volts2(chosen, chosen_noise)) {
      if (all.runout_at.x != 0.0 && !chosen.terms.runout) {
        all.runout_at = {};
        chosen = settle(chosen.terms);
      }
      break;
    }
    start = FrictionLaw::fromValues(best->terms.friction, best->fit.value.data(), all.zero_below);
    chosen = settle(best->terms);
  }

  // Scatter between the records, and rounding that is common to a record.
  const std::size_t n = chosen.fit.value.size(), at = all.ktcAt(chosen.terms);
  const Eigen::Index size = static_cast<Eigen::Index>(n), rows = static_cast<Eigen::Index>(chosen.residuals);
  Eigen::VectorXd rest(rows);
  all.residuals(chosen.terms, chosen.fit.value, rest.data());
  Eigen::MatrixXd jacobian(rows, size);
  for (Eigen::Index c = 0; c < size; ++c) {
    std::vector<double> v = chosen.fit.value;
    const double step = 1e-5 * (std::abs(v[static_cast<std::size_t>(c)]) + 1e-9);
    Eigen::VectorXd above(rows), below(rows);
    v[static_cast<std::size_t>(c)] += step;
    all.residuals(chosen.terms, v, above.data());
    v[static_cast<std::size_t>(c)] -= 2.0 * step;
    all.residuals(chosen.terms, v, below.data());
    jacobian.col(c) = (above - below) / (2.0 * step);
  }
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> covariance(
      chosen.fit.covariance.data(), size, size);
  Eigen::MatrixXd between = Eigen::MatrixXd::Zero(size, size), rounding = between;
  Eigen::Index row = 0;
  for (const LoadRecord& r : all.records) {
    const Eigen::Index k = r.target.size();
    const Eigen::MatrixXd part = jacobian.middleRows(row, k);
    const Eigen::VectorXd score = part.transpose() * rest.segment(row, k);
    between += score * score.transpose();
    // A constant error e of the voltage moves the target by pinv(rows)' sum e.
    const Eigen::VectorXd moved =
        part.transpose() * (r.rows.transpose().completeOrthogonalDecomposition().solve(r.sum)) / all.noise;
    rounding += moved * moved.transpose() * (r.rounding * r.rounding);
    row += k;
  }
  const double clusters = static_cast<double>(all.records.size());
  const double few = clusters / std::max(1.0, clusters - static_cast<double>(n));
  const Eigen::MatrixXd scatter = covariance * between * covariance * few;
  // Many records tell of their scatter themselves; few do not.
  const bool many = clusters >= 2.0 * static_cast<double>(n);
  const Eigen::MatrixXd from_noise = covariance * (many ? 1.0 : std::max(1.0, chosen.misfit));
  const Eigen::Index tc = static_cast<Eigen::Index>(at), te = tc + 1;
  Eigen::MatrixXd total = from_noise;
  if (scatter(tc, tc) * from_noise(te, te) + scatter(te, te) * from_noise(tc, tc) >
      2.0 * from_noise(tc, tc) * from_noise(te, te)) {
    total = scatter;
  }
  for (Eigen::Index i = 0; i < size; ++i) total(i, i) = std::max(from_noise(i, i), scatter(i, i));
  total += covariance * rounding * covariance;
  result.set.value = result.set.std_dev = NOT_IDENTIFIED;
  result.set.value.ktc = chosen.fit.value[at];
  result.set.value.kte = chosen.fit.value[at + 1];
  if (!ripple && tool.teeth > 1 && options.runout_uncertainty > 0.0) {
    const RunoutAverage average =
        averageOverRunout(all, chosen, options.runout_uncertainty * std::sqrt(3.0), tool);
    result.set.value.ktc = average.ktc;
    result.set.value.kte = average.kte;
    total(tc, tc) += average.variance_tc;
    total(te, te) += average.variance_te;
    total(tc, te) += average.covariance;
  }
  // Of load_meter_v_per_w and the depth: both coefficients follow them.
  const double scale = std::hypot(options.spindle_uncertainty ? stated : 0.0, options.depth_uncertainty);
  const auto stdOf = [&](Eigen::Index i, double value) {
    return std::sqrt(total(i, i) + scale * scale * value * value);
  };
  result.set.std_dev.ktc = stdOf(tc, result.set.value.ktc);
  result.set.std_dev.kte = stdOf(te, result.set.value.kte);
  result.covariance_tc_te = total(tc, te) + scale * scale * result.set.value.ktc * result.set.value.kte;
  result.friction = FrictionLaw::fromValues(chosen.terms.friction, chosen.fit.value.data(), all.zero_below);
  if (airs > 0) {
    result.set.friction_viscous = result.friction.viscous;
    result.set.friction_coulomb = result.friction.coulomb;
  }
  result.bandwidth = spindle.load_meter_bandwidth / std::exp(all.lag_at);
  if (chosen.terms.growth) result.edge_growth = chosen.fit.value[at + 2];
  if (chosen.terms.runout) {
    result.runout = std::hypot(all.runout_at.x, all.runout_at.y);
    result.runout_angle = std::atan2(all.runout_at.y, all.runout_at.x);
    if (result.runout_angle < 0.0) result.runout_angle += units::TWO_PI;
  }
  result.noise = all.noise;
  result.misfit = chosen.misfit;
  result.disagreement = chosen.share;
  if (chosen.terms.friction.stribeck) result.terms.push_back("Stribeck friction");
  if (chosen.terms.friction.warmup) result.terms.push_back("friction warm-up");
  if (chosen.terms.growth) result.terms.push_back("edge growth");
  if (chosen.terms.runout && !(options.runout_uncertainty > 0.0)) result.terms.push_back("runout");
  if (chosen.terms.lag && !options.spindle_uncertainty) result.terms.push_back("load meter's lag");
  if (chosen.misfit > 1.6 && chosen.share > MODEL_SHARE) {
    char text[200];
    std::snprintf(text, sizeof text,
                  "the records disagree by %.3f %% (chi2 %.1f a degree of freedom): something acts that the "
                  "model lacks, the coefficients carry its bias",
                  100.0 * chosen.share, chosen.misfit);
    result.notes.push_back(where + ": " + text);
  }
  result.set.source = "load_meter";
  result.set.tests = cuts;
  return result;
}

}  // namespace smartmill::loadmeter
