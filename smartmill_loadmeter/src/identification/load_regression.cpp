#include "load_regression.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_loadmeter/calibration/load_meter.h"

namespace smartmill::loadmeter {

LoadRegression::LoadRegression(const LoadPlan& plan, const Spindle& spindle, double spindle_uncertainty,
                               const LoadRecordOptions& options, const LoadRegressionOptions& regression)
    : plan_(plan), spindle_(spindle), options_(regression) {
  if (plan.air_cuts == 0) {
    // The model's friction is one observation of each term.
    const Friction known = modelFriction(spindle, 100.0 * spindle_uncertainty);
    const double smallest = 1e-6 * (std::abs(known.coulomb) + known.viscous * plan.fastest) + 1e-12;
    friction_priors_ = {{0, known.viscous, std::sqrt(known.covariance[0]) + smallest / plan.fastest},
                        {1, known.coulomb, std::sqrt(known.covariance[3]) + smallest}};
  }
  if (plan.has_angle) runout_prior_ = options.runout_uncertainty / std::sqrt(2.0);
  if (options.spindle_uncertainty) lag_prior_ = std::max(spindle_uncertainty, 1e-6);
}

LoadState LoadRegression::initialState(std::vector<LoadRecord> records, double noise) const {
  LoadState state;
  state.records = std::move(records);
  state.noise = noise;
  state.friction = {spindle_.friction()};
  state.friction.stribeck_speed = 0.15 * plan_.fastest;
  return state;
}

LoadTerms LoadRegression::initialTerms() const {
  LoadTerms terms;
  terms.lag = lag_prior_ > 0.0;
  terms.runout = runout_prior_ > 0.0;
  return terms;
}

std::size_t LoadRegression::residualCount(const LoadState& state) const {
  std::size_t n = friction_priors_.size() + (lag_prior_ > 0.0 ? 1 : 0) + (runout_prior_ > 0.0 ? 2 : 0);
  for (const LoadRecord& r : state.records) n += static_cast<std::size_t>(r.target.size());
  return n;
}

LoadRegression::Unknowns LoadRegression::unknownsOf(const LoadState& state, const LoadTerms& terms,
                                                    const std::vector<double>& v) const {
  Unknowns u{frictionLaw(terms.friction(), v.data(), spindle_.friction_zero_below),
             0.0,
             0.0,
             0.0,
             state.log_lag,
             {}};
  std::size_t at = terms.ktcIndex();
  u.ktc = v[at++];
  u.kte = v[at++];
  if (terms.growth) u.growth = v[at++];
  if (terms.runout) u.runout = {v[at], v[at + 1]}, at += 2;
  if (terms.lag) u.log_lag = v[at];
  return u;
}

void LoadRegression::residuals(const LoadState& state, const LoadTerms& terms, const std::vector<double>& v,
                               double* out) const {
  const Unknowns u = unknownsOf(state, terms, v);
  for (const LoadRecord& r : state.records) {
    LoadRow quantity = LoadRow::Zero();
    quantity[IDLE] = u.friction.torque(r.speed, r.start_time);
    if (r.cut) {
      quantity[KTC] = u.ktc * r.mean_ratio[0];
      quantity[KTE] = u.kte * (1.0 + u.growth * r.edge_age) * r.mean_ratio[1];
      quantity[LAG] = u.log_lag - state.log_lag;
      quantity[RUNOUT_X] = u.runout.x - state.point.runout.x;
      quantity[RUNOUT_Y] = u.runout.y - state.point.runout.y;
    }
    Eigen::Map<Eigen::VectorXd> residual(out, r.target.size());
    residual.noalias() = r.rows.lazyProduct(quantity.cwiseQuotient(loadUnits()));
    residual = (residual - r.target) / (state.noise * r.spread);
    out += residual.size();
  }
  for (const Prior& p : friction_priors_) *out++ = (v[p.unknown] - p.value) / p.std_dev;
  if (runout_prior_ > 0.0) {
    *out++ = u.runout.x / runout_prior_;
    *out++ = u.runout.y / runout_prior_;
  }
  if (lag_prior_ > 0.0) *out++ = u.log_lag / lag_prior_;
}

// chi2 of n degrees of freedom has mean n and variance 2 n.
bool LoadRegression::recordsDisagree(const LoadSolution& s) const {
  return s.misfit > 1.0 + options_.significant * std::sqrt(2.0 / s.freedom) &&
         s.disagreement > options_.model_accuracy;
}

FrictionLaw LoadRegression::frictionOf(const LoadSolution& s) const {
  return frictionLaw(s.terms.friction(), s.fit.value.data(), spindle_.friction_zero_below);
}

double LoadRegression::timeConstantOf(const LoadState& state) const {
  return timeConstant(spindle_.load_meter_bandwidth) * std::exp(state.log_lag);
}

LoadSolution LoadRegression::solve(const LoadState& state, const LoadTerms& terms,
                                   const FrictionLaw& start) const {
  std::vector<FitParameter> unknowns =
      frictionParameters(terms.friction(), plan_.slowest, plan_.fastest, start);
  unknowns.push_back({state.point.ktc, -1e12, 1e12, 1e9});
  unknowns.push_back({state.point.kte, -1e8, 1e8, 1e4});
  if (terms.growth) unknowns.push_back({0.0, -0.1, 1.0, 0.01});
  if (terms.runout) {
    unknowns.push_back({state.point.runout.x, -1e-4, 1e-4, 1e-5});
    unknowns.push_back({state.point.runout.y, -1e-4, 1e-4, 1e-5});
  }
  if (terms.lag) unknowns.push_back({state.log_lag, -3.0, 3.0, 0.1});
  LoadSolution s;
  s.terms = terms;
  const std::size_t count = residualCount(state);
  s.fit = fitLeastSquares([&](const std::vector<double>& v, double* out) { residuals(state, terms, v, out); },
                          count, unknowns);
  s.freedom = std::max(1.0, static_cast<double>(count) - static_cast<double>(terms.count()));
  s.misfit = s.fit.squares / s.freedom;
  double size2 = 0.0;
  for (const LoadRecord& r : state.records) size2 += r.target.squaredNorm() / (r.spread * r.spread);
  s.disagreement = state.noise * std::sqrt(s.fit.squares / size2);
  s.bic = plan_.has_transients ? bayesianInformationCriterion(s.fit.squares * state.noise * state.noise,
                                                              count, terms.count(), false)
                               : bayesianInformationCriterion(s.fit.squares, count, terms.count(), true);
  return s;
}

void LoadRegression::condense(LoadState* state) const {
  LoadPoint point = state->point;
  point.time_constant = timeConstantOf(*state);
  double squares = 0.0, freedom = 0.0;
  for (LoadRecord& r : state->records) {
    point.kte = state->point.kte * (1.0 + state->growth * r.edge_age);
    r.condense(spindle_, point);
    squares += r.residual_squares;
    freedom += static_cast<double>(r.voltage.size()) - static_cast<double>(r.target.size());
  }
  if (!plan_.has_transients) return;
  // At least a tenth of the rounding noise: a record without noise is not exact.
  state->noise =
      std::max(std::sqrt(squares / freedom), 0.1 * spindle_.load_meter_resolution / std::sqrt(12.0));
}

LoadState LoadRegression::converge(LoadState state, const LoadTerms& terms) const {
  const int passes = terms.runout ? options_.passes_with_runout
                     : terms.lag  ? options_.passes_with_lag
                                  : options_.passes;
  for (int pass = 0; pass < passes; ++pass) {
    condense(&state);
    state.solution = solve(state, terms, state.friction);
    const Unknowns u = unknownsOf(state, terms, state.solution.fit.value);
    state.point.ktc = u.ktc;
    state.point.kte = u.kte;
    state.growth = u.growth;
    if (terms.runout) state.point.runout = u.runout;
    state.log_lag = u.log_lag;
    state.friction = u.friction;
  }
  return state;
}

Eigen::MatrixXd LoadRegression::jacobian(const LoadState& state) const {
  const LoadSolution& solution = state.solution;
  const Eigen::Index size = static_cast<Eigen::Index>(solution.fit.value.size());
  const Eigen::Index rows = static_cast<Eigen::Index>(residualCount(state));
  Eigen::MatrixXd jacobian(rows, size);
  for (Eigen::Index c = 0; c < size; ++c) {
    std::vector<double> v = solution.fit.value;
    const double step = 1e-5 * (std::abs(v[static_cast<std::size_t>(c)]) + 1e-9);
    Eigen::VectorXd above(rows), below(rows);
    v[static_cast<std::size_t>(c)] += step;
    residuals(state, solution.terms, v, above.data());
    v[static_cast<std::size_t>(c)] -= 2.0 * step;
    residuals(state, solution.terms, v, below.data());
    jacobian.col(c) = (above - below) / (2.0 * step);
  }
  return jacobian;
}

Eigen::MatrixXd LoadRegression::covariance(const LoadState& state) const {
  const LoadSolution& solution = state.solution;
  const Eigen::Index size = static_cast<Eigen::Index>(solution.fit.value.size());
  Eigen::VectorXd residual(static_cast<Eigen::Index>(residualCount(state)));
  residuals(state, solution.terms, solution.fit.value, residual.data());
  const Eigen::MatrixXd slopes = jacobian(state);
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> covariance(
      solution.fit.covariance.data(), size, size);
  Eigen::MatrixXd between = Eigen::MatrixXd::Zero(size, size), rounding = between;
  Eigen::Index row = 0;
  for (const LoadRecord& r : state.records) {
    const Eigen::Index k = r.target.size();
    const Eigen::MatrixXd own = slopes.middleRows(row, k);
    const Eigen::VectorXd score = own.transpose() * residual.segment(row, k);
    between += score * score.transpose();
    row += k;
    if (!(r.rounding > 0.0)) continue;
    // A constant error e of the voltage shifts the target by pinv(rows)' sum e.
    const Eigen::VectorXd shift =
        own.transpose() * linear::leastNorm(r.rows.transpose(), r.sum) / state.noise;
    rounding += shift * shift.transpose() * (r.rounding * r.rounding);
  }
  const double clusters = static_cast<double>(state.records.size()), n = static_cast<double>(size);
  const double few = clusters / std::max(1.0, clusters - n);
  const Eigen::MatrixXd scatter = covariance * between * covariance * few;
  // Many records determine their scatter. For few records it has two or three degrees of freedom, and the
  // larger of two estimates would be too large on average: the noise is scaled by chi2 instead.
  const bool many = clusters >= 2.0 * n;
  const Eigen::MatrixXd from_noise = covariance * (many ? 1.0 : std::max(1.0, solution.misfit));
  if (!many) return from_noise + covariance * rounding * covariance;
  const Eigen::Index tc = static_cast<Eigen::Index>(solution.terms.ktcIndex()), te = tc + 1;
  Eigen::MatrixXd total = from_noise;
  if (scatter(tc, tc) * from_noise(te, te) + scatter(te, te) * from_noise(tc, tc) >
      2.0 * from_noise(tc, tc) * from_noise(te, te)) {
    total = scatter;
  }
  for (Eigen::Index i = 0; i < size; ++i) total(i, i) = std::max(from_noise(i, i), scatter(i, i));
  return total + covariance * rounding * covariance;
}

}  // namespace smartmill::loadmeter
