#include "load_estimator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <Eigen/Core>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/load_meter.h"

namespace smartmill::loadmeter {

namespace {

// Neither a machine nor an integrator follows the model more closely: what the records disagree by below this
// share of their voltage widens the standard deviations but is no reason to look for a cause.
constexpr double MODEL_SHARE = 2e-4;
// chi2 of n degrees of freedom has mean n and variance 2 n: beyond this many deviations with a probability of
// 1 %.
constexpr double UNLIKELY = 2.7;
// [1] standard deviation of the ripple's variance as the model has it: samples on many phases, on a few.
constexpr double RIPPLE_SHARE = 0.1, SPARSE_RIPPLE_SHARE = 0.3;
constexpr double FEW_PHASES = 3.0;

}  // namespace

std::size_t LoadEstimator::Terms::count() const {
  return friction.unknowns() + 2 + (growth ? 1 : 0) + (runout ? 2 : 0) + (lag ? 1 : 0);
}

bool LoadEstimator::Solution::disagrees() const {
  return misfit > 1.0 + UNLIKELY * std::sqrt(2.0 / freedom) && share > MODEL_SHARE;
}

LoadEstimator::LoadEstimator(std::vector<LoadRecord> records, const Spindle& spindle,
                             double spindle_uncertainty, const LoadRecordOptions& options, double noise,
                             bool timed, const std::string& where)
    : records_(std::move(records)),
      spindle_(spindle),
      stated_(spindle_uncertainty / 100.0),
      options_(options),
      known_noise_(noise > 0.0),
      timed_(timed),
      where_(where.empty() ? "" : where + ": "),
      noise_(noise) {
  std::set<double> air_speeds, ages;
  slowest_ = fastest_ = records_.empty() ? 0.0 : records_.front().speed;
  bool teeth = false;
  for (const LoadRecord& r : records_) {
    slowest_ = std::min(slowest_, r.speed);
    fastest_ = std::max(fastest_, r.speed);
    if (r.cut) {
      ++cuts_;
      ages.insert(r.edge_age);
      ripple_ = ripple_ || (r.has_angle && r.tool.teeth > 1);
      teeth = teeth || r.tool.teeth > 1;
    } else {
      ++airs_;
      if (r.speed >= spindle.friction_zero_below) air_speeds.insert(r.speed);
    }
  }
  air_speeds_ = air_speeds.size();
  ages_ = ages.size();
  if (teeth && !ripple_) largest_runout_ = options.runout_uncertainty * std::sqrt(3.0);
  checkPlan();
  setPriors();
}

void LoadEstimator::checkPlan() const {
  double slow = std::numeric_limits<double>::infinity(), fast = 0.0;
  std::set<long> chips;
  for (const LoadRecord& r : records_) {
    if (r.cut) {
      const auto map = meanForceMatrix(r.tool, r.engagement);
      chips.insert(std::lround(1e9 * map[3][0] / map[3][3]));
    } else if (r.speed >= spindle_.friction_zero_below) {
      slow = std::min(slow, r.speed);
      fast = std::max(fast, r.speed);
    }
  }
  // Readings of one commanded speed differ a little.
  if (airs_ > 0 && !(fast > 1.05 * slow)) {
    throw Error(where_ + "friction: air cuts at two or more speeds are due, " + std::to_string(air_speeds_) +
                " usable");
  }
  if (chips.size() < 3) {
    throw Error(where_ + "coefficients from torque: " + std::to_string(cuts_) + " cuts at " +
                std::to_string(chips.size()) + " different feeds; at least three are due");
  }
}

void LoadEstimator::setPriors() {
  start_.viscous = spindle_.viscous;
  start_.coulomb = spindle_.coulomb;
  start_.stribeck_speed = 0.15 * fastest_;
  if (airs_ == 0) {
    // What the model believes is one observation of each friction term.
    const Friction known = modelFriction(spindle_, 100.0 * stated_);
    const double smallest = 1e-6 * (std::abs(known.coulomb) + known.viscous * fastest_) + 1e-12;
    friction_priors_ = {{0, known.viscous, std::sqrt(known.covariance[0]) + smallest / fastest_},
                        {1, known.coulomb, std::sqrt(known.covariance[3]) + smallest}};
  }
  if (ripple_) runout_prior_ = options_.runout_uncertainty / std::sqrt(2.0);
  if (options_.spindle_uncertainty) lag_prior_ = std::max(stated_, 1e-6);
}

std::size_t LoadEstimator::residualCount() const {
  std::size_t n = friction_priors_.size() + (lag_prior_ > 0.0 ? 1 : 0) + (runout_prior_ > 0.0 ? 2 : 0);
  for (const LoadRecord& r : records_) n += static_cast<std::size_t>(r.target.size());
  return n;
}

void LoadEstimator::residuals(const Terms& terms, const std::vector<double>& v, double* out) const {
  const FrictionLaw law = FrictionLaw::fromValues(terms.friction, v.data(), spindle_.friction_zero_below);
  std::size_t at = terms.ktcAt();
  const double ktc = v[at++], kte = v[at++];
  const double growth = terms.growth ? v[at++] : 0.0;
  const Runout runout = terms.runout ? Runout{v[at], v[at + 1]} : Runout();
  if (terms.runout) at += 2;
  const double log_lag = terms.lag ? v[at++] : log_lag_;
  for (const LoadRecord& r : records_) {
    LoadRow quantity = LoadRow::Zero();
    quantity[IDLE] = law.torque(r.speed, r.start_time);
    if (r.cut) {
      quantity[KTC] = ktc * r.share[0];
      quantity[KTE] = kte * (1.0 + growth * r.edge_age) * r.share[1];
      quantity[LAG] = log_lag - log_lag_;
      quantity[RUNOUT_X] = runout.x - about_.runout.x;
      quantity[RUNOUT_Y] = runout.y - about_.runout.y;
    }
    const Eigen::VectorXd rest =
        (r.rows * quantity.cwiseQuotient(loadUnits()) - r.target) / (noise_ * r.spread);
    for (Eigen::Index i = 0; i < rest.size(); ++i) *out++ = rest[i];
  }
  for (const Prior& p : friction_priors_) *out++ = (v[p.unknown] - p.value) / p.std_dev;
  if (runout_prior_ > 0.0) {
    *out++ = runout.x / runout_prior_;
    *out++ = runout.y / runout_prior_;
  }
  if (lag_prior_ > 0.0) *out++ = log_lag / lag_prior_;
}

FrictionLaw LoadEstimator::lawOf(const Solution& s) const {
  return FrictionLaw::fromValues(s.terms.friction, s.fit.value.data(), spindle_.friction_zero_below);
}

LoadEstimator::Solution LoadEstimator::solve(const Terms& terms, const FrictionLaw& start) const {
  std::vector<FitParameter> unknowns = FrictionLaw::parameters(terms.friction, slowest_, fastest_, start);
  unknowns.push_back({about_.ktc, -1e12, 1e12, 1e9});
  unknowns.push_back({about_.kte, -1e8, 1e8, 1e4});
  if (terms.growth) unknowns.push_back({0.0, -0.1, 1.0, 0.01});
  if (terms.runout) {
    unknowns.push_back({about_.runout.x, -1e-4, 1e-4, 1e-5});
    unknowns.push_back({about_.runout.y, -1e-4, 1e-4, 1e-5});
  }
  if (terms.lag) unknowns.push_back({log_lag_, -3.0, 3.0, 0.1});
  Solution s;
  s.terms = terms;
  const std::size_t count = residualCount();
  s.fit = loadmeter::fit([&](const std::vector<double>& v, double* out) { residuals(terms, v, out); }, count,
                         unknowns);
  s.freedom = std::max(1.0, static_cast<double>(count) - static_cast<double>(terms.count()));
  s.misfit = s.fit.squares / s.freedom;
  double size2 = 0.0;
  for (const LoadRecord& r : records_) size2 += r.target.squaredNorm() / (r.spread * r.spread);
  s.share = noise_ * std::sqrt(s.fit.squares / size2);
  s.bic = known_noise_ ? informationCriterion(s.fit.squares, count, terms.count(), true)
                       : informationCriterion(s.fit.squares * noise_ * noise_, count, terms.count(), false);
  return s;
}

void LoadEstimator::condenseAll() {
  LoadPoint about = about_;
  about.time_constant = timeConstant(spindle_.load_meter_bandwidth) * std::exp(log_lag_);
  double left = 0.0, freedom = 0.0;
  for (LoadRecord& r : records_) {
    about.kte = about_.kte * (1.0 + growth_ * r.edge_age);
    r.condense(spindle_, about);
    left += r.left;
    freedom += static_cast<double>(r.voltage.size()) - static_cast<double>(r.target.size());
  }
  if (known_noise_) return;
  // The rounding's own spread is a floor: a record without noise does not stand for an exact reading.
  noise_ = std::max(std::sqrt(left / freedom), 0.1 * spindle_.load_meter_resolution / std::sqrt(12.0));
}

// Again about what was found: the columns of lag and runout hang on the coefficients, and on themselves.
LoadEstimator::Solution LoadEstimator::settle(const Terms& terms) {
  Solution s;
  for (int pass = 0; pass < (terms.runout ? 6 : terms.lag ? 4 : 2); ++pass) {
    condenseAll();
    s = solve(terms, start_);
    std::size_t at = terms.ktcAt();
    about_.ktc = s.fit.value[at++];
    about_.kte = s.fit.value[at++];
    growth_ = terms.growth ? s.fit.value[at++] : 0.0;
    if (terms.runout) about_.runout = {s.fit.value[at], s.fit.value[at + 1]};
    if (terms.lag) log_lag_ = s.fit.value.back();
    start_ = lawOf(s);
  }
  return s;
}

std::vector<LoadEstimator::Terms> LoadEstimator::furtherTerms() const {
  std::vector<Terms> tries;
  const std::size_t residuals = residualCount();
  const auto with = [&](bool possible, auto change) {
    Terms t = chosen_.terms;
    change(t);
    if (possible && t.count() + 2 <= residuals) tries.push_back(t);
  };
  const Terms& now = chosen_.terms;
  with(!now.friction.stribeck && air_speeds_ >= 4, [](Terms& t) { t.friction.stribeck = true; });
  with(!now.friction.warmup && timed_, [](Terms& t) { t.friction.warmup = true; });
  with(!now.growth && ages_ >= 3, [](Terms& t) { t.growth = true; });
  with(!now.lag && !known_noise_, [](Terms& t) { t.lag = true; });  // means hold no transient
  return tries;
}

// A further friction term from several starting points.
LoadEstimator::Solution LoadEstimator::bestStart(const Terms& terms) const {
  const bool stribeck = terms.friction.stribeck && !chosen_.terms.friction.stribeck;
  const bool warmup = terms.friction.warmup && !chosen_.terms.friction.warmup;
  std::optional<Solution> best;
  for (const double share : {0.1, 0.25}) {
    for (const double constant : {150.0, 600.0, 2400.0}) {
      FrictionLaw from = start_;
      if (!chosen_.terms.friction.stribeck) from.stribeck_speed = std::max(share * fastest_, slowest_);
      if (!chosen_.terms.friction.warmup) from.warmup_time = constant;
      const Solution s = solve(terms, from);
      if (!best || s.bic < best->bic) best = s;
      if (!warmup) break;
    }
    if (!stribeck) break;
  }
  return *best;
}

// The one term more that the evidence favours by more than ten. @return whether there was one.
bool LoadEstimator::addTerm() {
  std::optional<Solution> best;
  for (const Terms& t : furtherTerms()) {
    const Solution s = bestStart(t);
    if (!best || s.bic < best->bic) best = s;
  }
  std::optional<LoadEstimator> with_runout;
  if (!chosen_.terms.runout && ripple_) {
    // Runout changes the shape of the responses: condensed anew about what it finds.
    Terms t = chosen_.terms;
    t.runout = true;
    with_runout = *this;
    const Solution s = with_runout->settle(t);
    if (!best || s.bic < best->bic) {
      best = s;
    } else {
      with_runout.reset();
    }
  }
  if (!best || best->bic > chosen_.bic - 10.0) return false;
  // Half of the disagreement must go with it: a wrong cause always takes up some.
  const auto volts2 = [](const Solution& s, double noise) { return s.fit.squares * noise * noise; };
  if (volts2(*best, with_runout ? with_runout->noise_ : noise_) > 0.5 * volts2(chosen_, noise_)) return false;
  if (with_runout) *this = *with_runout;
  start_ = lawOf(*best);
  chosen_ = settle(best->terms);
  return true;
}

/// One offset of the cutter axis at one angle, and the fit it leaves.
struct LoadEstimator::RunoutPoint {
  double offset;
  std::size_t angle;
  Solution solution;
  double evidence = 0.0;  // log of the likelihood, beyond a constant
};

void LoadEstimator::tabulateRunout() {
  const double time_constant = timeConstant(spindle_.load_meter_bandwidth) * std::exp(log_lag_);
  effects_.clear();
  double sum = 0.0, samples = 0.0;
  for (const LoadRecord& r : records_) {
    if (r.cut) {
      effects_.emplace_back(r, spindle_, time_constant, largest_runout_);
    } else {
      sum += r.samples * r.variance;
      samples += r.samples;
    }
  }
  const double rounding = std::pow(spindle_.load_meter_resolution, 2) / 12.0;
  air_known_ = samples > 0.0;
  air_variance_ = std::max(rounding, air_known_ ? sum / samples : 0.0);
}

// How well the scatter of the readings goes with the ripple of a runout: as likely as not the ripple is all
// that the air cuts do not show, else a cut adds noise of its own, of whatever size.
double LoadEstimator::scatterEvidence(const RunoutPoint& point) const {
  constexpr int SIZES = 16;
  std::vector<double> evidence(SIZES + 1, 0.0);
  double largest = 0.0;
  for (const LoadRecord& r : records_) {
    if (r.cut && r.samples > 0.0) largest = std::max(largest, 2.0 * std::sqrt(r.variance));
  }
  if (!(largest > 0.0)) return 0.0;
  std::size_t cut = 0;
  for (const LoadRecord& r : records_) {
    if (!r.cut) continue;
    const RunoutEffect& effect = effects_[cut++];
    if (!(r.samples > 0.0)) continue;
    RunoutEffect::Variance v =
        effect.variance(point.offset, point.angle, point.solution.ktc(), point.solution.kte());
    v.ripple *= r.in_cut;
    const double share = r.sparse ? SPARSE_RIPPLE_SHARE : RIPPLE_SHARE;
    for (int i = 0; i <= SIZES; ++i) {
      const double noise = air_variance_ + std::pow(largest * i / SIZES, 2);
      const double variance = 2.0 * noise * noise / r.samples +
                              4.0 * noise * v.ripple / (r.sparse ? FEW_PHASES : r.samples) +
                              std::pow(share * v.ripple, 2) + (r.sparse ? std::pow(v.interference, 2) : 0.0);
      const double rest = r.variance - noise - v.ripple;
      evidence[static_cast<std::size_t>(i)] -= 0.5 * (rest * rest / variance + std::log(variance));
    }
  }
  const double best = *std::max_element(evidence.begin(), evidence.end());
  double with_noise = 0.0;
  for (int i = 1; i <= SIZES; ++i)
    with_noise += std::exp(evidence[static_cast<std::size_t>(i)] - best) / SIZES;
  const double alone = air_known_ ? std::exp(evidence[0] - best) : with_noise;
  return best + std::log(0.5 * (alone + with_noise));
}

std::vector<LoadEstimator::RunoutPoint> LoadEstimator::tryOffsets(double low, double high) const {
  constexpr int OFFSETS = 25;
  std::vector<RunoutPoint> points;
  LoadEstimator with = *this;
  for (int o = 0; o < OFFSETS; ++o) {
    for (std::size_t a = 0; a < RunoutEffect::ANGLES; ++a) {
      RunoutPoint p{low + (high - low) * o / (OFFSETS - 1), a, {}};
      std::size_t cut = 0;
      for (LoadRecord& r : with.records_) {
        if (r.cut) r.share = effects_[cut++].share(p.offset, a);
      }
      p.solution = with.solve(chosen_.terms, lawOf(chosen_));
      points.push_back(p);
    }
  }
  double misfit = std::numeric_limits<double>::infinity();
  for (const RunoutPoint& p : points) misfit = std::min(misfit, p.solution.misfit);
  for (RunoutPoint& p : points) {
    p.evidence = scatterEvidence(p) - 0.5 * p.solution.fit.squares / std::max(1.0, misfit);
  }
  return points;
}

// Where teeth miss part of their arc runout only ever takes away edge: an offset of zero is no middle, so
// each offset has its own fit, weighted by how well means and scatter of the records go with it.
LoadEstimator::RunoutAverage LoadEstimator::averageOverRunout() const {
  constexpr double NEGLIGIBLE = -12.0;  // log of a weight
  const auto largestOf = [](const std::vector<RunoutPoint>& points) {
    return std::max_element(
               points.begin(), points.end(),
               [](const RunoutPoint& a, const RunoutPoint& b) { return a.evidence < b.evidence; })
        ->evidence;
  };
  std::vector<RunoutPoint> points = tryOffsets(0.0, largest_runout_);
  const double coarse = largestOf(points), step = largest_runout_ / 24.0;
  double none = -std::numeric_limits<double>::infinity(), low = largest_runout_, high = 0.0;
  for (const RunoutPoint& p : points) {
    if (p.offset == 0.0) none = std::max(none, p.evidence);
    if (p.evidence < coarse + NEGLIGIBLE) continue;
    low = std::min(low, p.offset);
    high = std::max(high, p.offset);
  }
  points = tryOffsets(std::max(0.0, low - step), std::min(largest_runout_, high + step));
  const double best = largestOf(points);
  RunoutAverage average;
  average.shown = none < best - 5.0;
  double sum = 0.0;
  const auto weight = [&](const RunoutPoint& p) { return std::exp(p.evidence - best); };
  for (const RunoutPoint& p : points) {
    sum += weight(p);
    average.offset += weight(p) * p.offset;
    average.ktc += weight(p) * p.solution.ktc();
    average.kte += weight(p) * p.solution.kte();
  }
  average.offset /= sum;
  average.ktc /= sum;
  average.kte /= sum;
  for (const RunoutPoint& p : points) {
    const double c = p.solution.ktc() - average.ktc, e = p.solution.kte() - average.kte;
    const double w = weight(p) / sum;
    average.variance_tc += w * c * c;
    average.variance_te += w * e * e;
    average.covariance += w * c * e;
  }
  return average;
}

void LoadEstimator::takeRunout() {
  average_ = averageOverRunout();
  std::size_t cut = 0;
  for (LoadRecord& r : records_) {
    if (r.cut) r.share = effects_[cut++].share(average_.offset);
  }
  chosen_ = settle(chosen_.terms);
}

// Readings that meet the same phases of the ripple again and again do not average it away.
void LoadEstimator::widenLocked() {
  std::size_t cut = 0;
  for (LoadRecord& r : records_) {
    if (!r.cut) continue;
    const RunoutEffect& effect = effects_[cut++];
    const double locked = effect.lockedVariance(average_.offset, average_.ktc, average_.kte, r.locked);
    r.spread = std::hypot(r.spread, std::sqrt(locked) / noise_);
  }
}

Eigen::MatrixXd LoadEstimator::jacobian() const {
  const Eigen::Index size = static_cast<Eigen::Index>(chosen_.fit.value.size());
  const Eigen::Index rows = static_cast<Eigen::Index>(residualCount());
  Eigen::MatrixXd jacobian(rows, size);
  for (Eigen::Index c = 0; c < size; ++c) {
    std::vector<double> v = chosen_.fit.value;
    const double step = 1e-5 * (std::abs(v[static_cast<std::size_t>(c)]) + 1e-9);
    Eigen::VectorXd above(rows), below(rows);
    v[static_cast<std::size_t>(c)] += step;
    residuals(chosen_.terms, v, above.data());
    v[static_cast<std::size_t>(c)] -= 2.0 * step;
    residuals(chosen_.terms, v, below.data());
    jacobian.col(c) = (above - below) / (2.0 * step);
  }
  return jacobian;
}

// Of all unknowns: from the noise or from the scatter between the records, whichever is larger, and from the
// rounding that is common to a record.
Eigen::MatrixXd LoadEstimator::covariance() const {
  const Eigen::Index size = static_cast<Eigen::Index>(chosen_.fit.value.size());
  Eigen::VectorXd rest(static_cast<Eigen::Index>(residualCount()));
  residuals(chosen_.terms, chosen_.fit.value, rest.data());
  const Eigen::MatrixXd slopes = jacobian();
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> covariance(
      chosen_.fit.covariance.data(), size, size);
  Eigen::MatrixXd between = Eigen::MatrixXd::Zero(size, size), rounding = between;
  Eigen::Index row = 0;
  for (const LoadRecord& r : records_) {
    const Eigen::Index k = r.target.size();
    const Eigen::MatrixXd part = slopes.middleRows(row, k);
    const Eigen::VectorXd score = part.transpose() * rest.segment(row, k);
    between += score * score.transpose();
    row += k;
    if (!(r.rounding > 0.0)) continue;
    // A constant error e of the voltage moves the target by pinv(rows)' sum e.
    const Eigen::VectorXd moved = part.transpose() * linear::leastNorm(r.rows.transpose(), r.sum) / noise_;
    rounding += moved * moved.transpose() * (r.rounding * r.rounding);
  }
  const double clusters = static_cast<double>(records_.size()), n = static_cast<double>(size);
  const double few = clusters / std::max(1.0, clusters - n);
  const Eigen::MatrixXd scatter = covariance * between * covariance * few;
  // Many records tell of their scatter themselves; few do not, and the larger of two estimates, one of them
  // by two or three degrees of freedom, would be too large on the average: theirs counts by what is left in
  // all.
  const bool many = clusters >= 2.0 * n;
  const Eigen::MatrixXd from_noise = covariance * (many ? 1.0 : std::max(1.0, chosen_.misfit));
  if (!many) return from_noise + covariance * rounding * covariance;
  const Eigen::Index tc = static_cast<Eigen::Index>(chosen_.terms.ktcAt()), te = tc + 1;
  Eigen::MatrixXd total = from_noise;
  if (scatter(tc, tc) * from_noise(te, te) + scatter(te, te) * from_noise(tc, tc) >
      2.0 * from_noise(tc, tc) * from_noise(te, te)) {
    total = scatter;
  }
  for (Eigen::Index i = 0; i < size; ++i) total(i, i) = std::max(from_noise(i, i), scatter(i, i));
  return total + covariance * rounding * covariance;
}

LoadRecordResult LoadEstimator::estimate() {
  Terms terms;
  terms.lag = options_.spindle_uncertainty;
  terms.runout = runout_prior_ > 0.0;
  chosen_ = settle(terms);
  if (averages()) {
    tabulateRunout();
    average_ = averageOverRunout();
    widenLocked();
    takeRunout();
  }
  bool added = false;
  while (options_.choose_terms && chosen_.disagrees() && addTerm()) added = true;
  if (averages() && added) takeRunout();
  return result();
}

LoadRecordResult LoadEstimator::result() const {
  LoadRecordResult result;
  const Eigen::Index tc = static_cast<Eigen::Index>(chosen_.terms.ktcAt()), te = tc + 1;
  Eigen::MatrixXd total = covariance();
  CoefficientSet& set = result.set;
  set.value = set.std_dev = NOT_IDENTIFIED;
  set.value.ktc = chosen_.ktc();
  set.value.kte = chosen_.kte();
  if (averages()) {
    set.value.ktc = average_.ktc;
    set.value.kte = average_.kte;
    total(tc, tc) += average_.variance_tc;
    total(te, te) += average_.variance_te;
    total(tc, te) += average_.covariance;
  }
  // Of load_meter_v_per_w and the depth: both coefficients follow them.
  const double scale = std::hypot(options_.spindle_uncertainty ? stated_ : 0.0, options_.depth_uncertainty);
  const auto stdOf = [&](Eigen::Index i, double value) {
    return std::sqrt(total(i, i) + scale * scale * value * value);
  };
  set.std_dev.ktc = stdOf(tc, set.value.ktc);
  set.std_dev.kte = stdOf(te, set.value.kte);
  result.covariance_tc_te = total(tc, te) + scale * scale * set.value.ktc * set.value.kte;
  set.source = "load_meter";
  set.tests = static_cast<int>(cuts_);
  describe(&result);
  return result;
}

// What was found beside the coefficients.
void LoadEstimator::describe(LoadRecordResult* result) const {
  const Terms& terms = chosen_.terms;
  result->friction = lawOf(chosen_);
  if (airs_ > 0) {
    result->set.friction_viscous = result->friction.viscous;
    result->set.friction_coulomb = result->friction.coulomb;
  }
  result->bandwidth = spindle_.load_meter_bandwidth / std::exp(log_lag_);
  if (terms.growth) result->edge_growth = growth_;
  if (terms.runout) {
    result->runout = std::hypot(about_.runout.x, about_.runout.y);
    result->runout_angle = std::atan2(about_.runout.y, about_.runout.x);
    if (result->runout_angle < 0.0) result->runout_angle += units::TWO_PI;
  } else if (averages() && average_.shown) {
    result->runout = average_.offset;
    result->runout_angle = std::numeric_limits<double>::quiet_NaN();
  }
  result->noise = noise_;
  result->misfit = chosen_.misfit;
  result->disagreement = chosen_.share;
  if (terms.friction.stribeck) result->terms.push_back("Stribeck friction");
  if (terms.friction.warmup) result->terms.push_back("friction warm-up");
  if (terms.growth) result->terms.push_back("edge growth");
  if (terms.runout && !(options_.runout_uncertainty > 0.0)) result->terms.push_back("runout");
  if (terms.lag && !options_.spindle_uncertainty) result->terms.push_back("load meter's lag");
  if (chosen_.disagrees()) {
    result->notes.push_back(
        where_ +
        formatted("the records disagree by %.3f %% (chi2 %.1f a degree of freedom): something acts that the "
                  "model lacks, the coefficients carry its bias",
                  100.0 * chosen_.share, chosen_.misfit));
  }
}

}  // namespace smartmill::loadmeter
