#include "smartmill_discrepancy/search/screening.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <random>
#include <utility>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_discrepancy/search/mode_probes.h"
#include "smartmill_discrepancy/search/order_probes.h"
#include "smartmill_sim/effects/effect_set.h"

namespace smartmill::discrepancy {
namespace {

using Eigen::Index;

// Weighted subset of the samples of a campaign: one of four, chosen at random to avoid aliasing, and all
// samples of short spans.
class ThinnedSamples {
 public:
  explicit ThinnedSamples(const TwinRunner& runner) {
    constexpr std::size_t EVERY = 4, FEW = 256;
    std::minstd_rand random(1);
    for (const ChannelSpan& b : runner.spans()) {
      const std::size_t every = b.size < FEW ? 1 : EVERY;
      for (std::size_t i = 0; i + every <= b.size; i += every) {
        rows_.push_back(static_cast<Index>(b.offset + i + (every > 1 ? random() % every : 0)));
        weights_.push_back(std::sqrt(static_cast<double>(every)));
      }
    }
  }

  Eigen::VectorXd of(const Eigen::VectorXd& values) const { return weighted(values(rows_)); }
  Eigen::MatrixXd of(const SparseColumns& columns) const { return weighted(columns.rows(rows_)); }
  /// Weights columns given at these samples.
  Eigen::MatrixXd weighted(Eigen::MatrixXd values) const {
    values.array().colwise() *= weights().array();
    return values;
  }
  const std::vector<Index>& rows() const { return rows_; }

 private:
  Eigen::Map<const Eigen::VectorXd> weights() const {
    return {weights_.data(), static_cast<Index>(weights_.size())};
  }

  std::vector<Index> rows_;
  std::vector<double> weights_;
};

// Orthogonal projection off the derivatives of the nominal values (with their priors), the alignment and the
// members.
class Projection {
 public:
  Projection(const Fitter& fitter, const FitResult& now, const NominalTangents& tangents)
      : freedom_(fitter.freedom().coordinates()),
        nominal_(now.state.nominal),
        tangents_(tangents),
        residual_(Eigen::Map<const Eigen::VectorXd>(now.residual.data(),
                                                    static_cast<Index>(fitter.runner().size()))),
        thinned_(fitter.runner()) {
    addMembers(fitter, now.state);
    information_.resize(prior_.size(), prior_.size());
    information_.leftCols(tangents.columns.cols()) =
        stacked(tangents.information, members_.cross(tangents.columns));
    information_.rightCols(members_.cols()) = stacked(tangents.columns.cross(members_), members_.gram());
    information_.diagonal() += prior_;
    pull_ = Eigen::VectorXd::Zero(prior_.size());
    for (std::size_t c = 0; c < freedom_.size(); ++c)
      pull_[static_cast<Index>(c)] = -nominal_[c] * prior_[static_cast<Index>(c)];
    for (std::size_t k = 0; k < tangents.alignment.size(); ++k) {
      const auto at = static_cast<Index>(freedom_.size() + k);
      if (fitter.alignment()[k].freedom.value == &RecordAlignment::entry && !now.state.alignment.empty())
        pull_[at] = -now.state.alignment[k] * prior_[at];
    }
    score_ = stacked(tangents.columns.along(residual_), members_.along(residual_)) + pull_;
    baseline_ = withinBounds(information_, score_);
    Eigen::VectorXd residual = residual_;
    move(-baseline_.by, &residual);
    baseline_residual_ = std::make_shared<const Eigen::VectorXd>(std::move(residual));
    thinSamples();
  }

  const SimulatedChannels& base() const { return base_; }
  const ThinnedSamples& thinned() const { return thinned_; }

  // Reduction of the cost by columns with all other values free.
  struct Reduction {
    double gain = 0.0;  // [1] of chi2 and priors
    Eigen::VectorXd amplitudes;
    double independent_share = 1.0;  // [1] share of the columns that the other values cannot replace
    Eigen::VectorXd all_else;
  };
  Reduction reduction(const SparseColumns& columns) const {
    return reduction(information_, score_, baseline_.by, crossWith(columns), columns.gram(),
                     columns.along(residual_));
  }

  // Change of the simulation with the columns relative to that without them.
  void addChange(const SparseColumns& columns, const Reduction& reduction, PredictedGain* predicted) const {
    auto change = std::make_shared<Eigen::VectorXd>(Eigen::VectorXd::Zero(residual_.size()));
    columns.addTo(reduction.amplitudes, change.get());
    move(reduction.all_else - baseline_.by, change.get());
    predicted->change = std::move(change);
    predicted->baseline_residual = baseline_residual_;
    for (std::size_t c = 0; c < freedom_.size(); ++c) {
      const double by = reduction.all_else[static_cast<Index>(c)];
      const double d = (by - baseline_.by[static_cast<Index>(c)]) / freedom_[c].prior_std;
      predicted->prior_evidence.squares += d * d;
      predicted->prior_evidence.product -= d * (nominal_[c] + by - freedom_[c].null) / freedom_[c].prior_std;
    }
  }

  // Approximate gain from thinned columns.
  double roughGain(const Eigen::MatrixXd& columns) const {
    return reduction(thinned_information_, thinned_score_, thinned_baseline_,
                     thinned_columns_.transpose() * columns, columns.transpose() * columns,
                     columns.transpose() * thinned_residual_)
        .gain;
  }

  // The same for single columns; 0 if a column is zero or not finite or has an impossible sign.
  Eigen::VectorXd roughGains(const Eigen::MatrixXd& columns, bool positive) const {
    Eigen::MatrixXd cross = thinned_columns_.transpose() * columns;
    for (const Index c : baseline_.at_bounds) cross.row(c).setZero();
    const Eigen::MatrixXd solved = linear::solveSymmetric(thinned_fixed_information_, cross);
    const Eigen::VectorXd raw = columns.colwise().squaredNorm();
    const Eigen::VectorXd own = raw - (cross.cwiseProduct(solved)).colwise().sum().transpose();
    const Eigen::VectorXd score = columns.transpose() * thinned_baseline_residual_;
    Eigen::VectorXd result = Eigen::VectorXd::Zero(columns.cols());
    for (Index k = 0; k < columns.cols(); ++k) {
      if (!std::isfinite(own[k]) || !std::isfinite(score[k]) || raw[k] == 0.0) continue;
      if (!positive || score[k] > 0.0) result[k] = score[k] * score[k] / (own[k] + 1e-9 * raw[k] + 1e-30);
    }
    return result;
  }

 private:
  static Eigen::MatrixXd stacked(const Eigen::MatrixXd& upper, const Eigen::MatrixXd& lower) {
    Eigen::MatrixXd all(upper.rows() + lower.rows(), upper.cols());
    all << upper, lower;
    return all;
  }

  Eigen::MatrixXd crossWith(const SparseColumns& columns) const {
    return stacked(tangents_.columns.cross(columns), members_.cross(columns));
  }

  // vector += change by nominal values, alignment and members.
  void move(const Eigen::VectorXd& by, Eigen::VectorXd* vector) const {
    tangents_.columns.addTo(by.head(tangents_.columns.cols()), vector);
    members_.addTo(by.tail(members_.cols()), vector);
  }

  static double reduction(const Eigen::MatrixXd& information, const Eigen::VectorXd& score,
                          const Eigen::VectorXd& by) {
    return 2.0 * score.dot(by) - by.dot(information * by);
  }

  Reduction reduction(const Eigen::MatrixXd& information, const Eigen::VectorXd& score,
                      const Eigen::VectorXd& baseline, const Eigen::MatrixXd& cross, Eigen::MatrixXd own,
                      const Eigen::VectorXd& along) const {
    const Index fixed_count = information.rows(), count = own.rows();
    const double raw = own.trace();
    own.diagonal() = own.diagonal().array() * (1.0 + 1e-9) + 1e-30;
    Eigen::MatrixXd all(fixed_count + count, fixed_count + count);
    all << information, cross, cross.transpose(), own;
    Eigen::VectorXd right(fixed_count + count);
    right << score, along;
    const ConstrainedStep step = withinBounds(all, right);
    Reduction result;
    result.gain = reduction(all, right, step.by) - reduction(information, score, baseline);
    result.amplitudes = step.by.tail(count);
    result.all_else = step.by.head(fixed_count);
    const Eigen::MatrixXd at_bounds = fixedAt(step.at_bounds, information);
    Eigen::MatrixXd free = cross;
    for (const Index c : step.at_bounds) free.row(c).setZero();
    result.independent_share =
        (own - free.transpose() * linear::solveSymmetric(at_bounds, free)).trace() / raw;
    return result;
  }

  // Derivatives of the members' values.
  void addMembers(const Fitter& fitter, const FitState& state) {
    std::vector<std::size_t> all(state.members.size());
    std::iota(all.begin(), all.end(), 0u);
    members_ = memberTangents(fitter, state, all, &base_);
    const Index fixed_count = tangents_.columns.cols();
    prior_.resize(fixed_count + members_.cols());
    for (std::size_t k = 0; k < tangents_.alignment.size(); ++k)
      prior_[static_cast<Index>(freedom_.size() + k)] =
          std::pow(fitter.alignment()[k].freedom.prior_std, -2.0);
    for (std::size_t c = 0; c < freedom_.size(); ++c)
      prior_[static_cast<Index>(c)] = 1.0 / (freedom_[c].prior_std * freedom_[c].prior_std);
    prior_.tail(members_.cols()) = 1e-12 + 1e-9 * members_.squares().array();
  }

  // Step of all values, and the nominal values at their bounds.
  struct ConstrainedStep {
    Eigen::VectorXd by;
    std::vector<Index> at_bounds;
  };

  Eigen::MatrixXd fixedAt(const std::vector<Index>& at_bounds, Eigen::MatrixXd information) const {
    for (const Index c : at_bounds) {
      information.row(c).setZero();
      information.col(c).setZero();
      information(c, c) = prior_[c];
    }
    return information;
  }

  // Values beyond a bound are fixed there one by one, the furthest first; the columns may bring back values
  // that are at a bound without them.
  ConstrainedStep withinBounds(const Eigen::MatrixXd& information, const Eigen::VectorXd& right) const {
    constexpr double TOLERANCE = 0.01;  // standard deviations
    ConstrainedStep step;
    Eigen::VectorXd at_bound = Eigen::VectorXd::Zero(right.size());
    for (;;) {
      Eigen::VectorXd score = right - information * at_bound;
      for (const Index c : step.at_bounds) score[c] = 0.0;
      step.by = linear::solveSymmetric(fixedAt(step.at_bounds, information), score) + at_bound;
      double worst = TOLERANCE;
      Index which = -1;
      for (std::size_t k = 0; k < freedom_.size(); ++k) {
        const auto c = static_cast<Index>(k);
        if (std::find(step.at_bounds.begin(), step.at_bounds.end(), c) != step.at_bounds.end()) continue;
        const double to = nominal_[k] + step.by[c];
        const double beyond = std::max(freedom_[k].low - to, to - freedom_[k].high) / freedom_[k].prior_std;
        if (beyond <= worst) continue;
        worst = beyond;
        which = c;
      }
      if (which < 0) return step;
      const Coordinate& over = freedom_[static_cast<std::size_t>(which)];
      const double at = nominal_[static_cast<std::size_t>(which)];
      at_bound[which] = (step.by[which] > 0.0 ? over.high : over.low) - at;
      step.at_bounds.push_back(which);
    }
  }

  // Thinned residual and derivatives.
  void thinSamples() {
    const Eigen::MatrixXd nominal = thinned_.of(tangents_.columns), members = thinned_.of(members_);
    thinned_columns_.resize(nominal.rows(), nominal.cols() + members.cols());
    thinned_columns_ << nominal, members;
    thinned_residual_ = thinned_.of(residual_);
    thinned_baseline_residual_ = thinned_.of(*baseline_residual_);
    thinned_information_.setZero(thinned_columns_.cols(), thinned_columns_.cols());
    if (thinned_columns_.size() > 0)
      thinned_information_.selfadjointView<Eigen::Lower>().rankUpdate(thinned_columns_.transpose());
    thinned_information_ = thinned_information_.selfadjointView<Eigen::Lower>();
    thinned_information_.diagonal() += prior_;
    thinned_fixed_information_ = fixedAt(baseline_.at_bounds, thinned_information_);
    thinned_score_ = thinned_columns_.transpose() * thinned_residual_ + pull_;
    thinned_baseline_ = withinBounds(thinned_information_, thinned_score_).by;
  }

  const std::vector<Coordinate>& freedom_;
  const std::vector<double>& nominal_;
  const NominalTangents& tangents_;
  SimulatedChannels base_;
  SparseColumns members_;
  Eigen::VectorXd prior_, residual_, pull_, score_;  // pull: of the priors, part of the score
  Eigen::MatrixXd information_;
  ConstrainedStep baseline_;  // without columns
  std::shared_ptr<const Eigen::VectorXd> baseline_residual_;
  ThinnedSamples thinned_;
  Eigen::MatrixXd thinned_columns_, thinned_information_, thinned_fixed_information_;
  Eigen::VectorXd thinned_residual_, thinned_baseline_residual_, thinned_score_, thinned_baseline_;
};

// The two best frequencies of a mode, at least a third of an octave apart, from first-order columns.
std::vector<double> bestFrequencies(const Projection& projection, const TwinRunner& runner,
                                    const std::vector<double>& frequencies,
                                    const std::function<Eigen::MatrixXd(const std::vector<double>&)>& columns,
                                    bool positive) {
  constexpr std::size_t BATCH = 8;  // frequencies per pass over the derivatives
  std::vector<double> gains(frequencies.size(), 0.0);
  runParallel((frequencies.size() + BATCH - 1) / BATCH, runner.threads(), [&](std::size_t batch) {
    const std::size_t first = batch * BATCH, count = std::min(BATCH, frequencies.size() - first);
    const auto from = frequencies.begin() + static_cast<std::ptrdiff_t>(first);
    const Eigen::VectorXd each = projection.roughGains(
        projection.thinned().weighted(columns({from, from + static_cast<std::ptrdiff_t>(count)})), positive);
    for (std::size_t k = 0; k < count; ++k) gains[first + k] = each[static_cast<Index>(k)];
  });
  std::vector<double> best;
  for (int n = 0; n < 2; ++n) {
    const auto top = std::max_element(gains.begin(), gains.end());
    if (*top <= 0.0) break;
    const double f = frequencies[static_cast<std::size_t>(top - gains.begin())];
    best.push_back(f);
    for (std::size_t k = 0; k < gains.size(); ++k) {
      if (std::abs(std::log(frequencies[k] / f)) < 0.23) gains[k] = 0.0;
    }
  }
  return best;
}

// Finds probes of an effect with unknown location: frequency of a mode, order of a line.
class ProbeFinder {
 public:
  using Probes = std::vector<Hypothesis::Probe>;

  ProbeFinder(const Projection& projection, const TwinRunner& runner, const MachineModel& model,
              const FitResult& now)
      : projection_(projection),
        runner_(runner),
        model_(model),
        now_(now),
        probes_(runner, model, projection.thinned().rows()) {}

  Probes probesOf(const Hypothesis& h) {
    switch (h.strategy) {
      case Hypothesis::SearchStrategy::none:
        return h.probes;
      case Hypothesis::SearchStrategy::sensor_mode:
        return sensorModes(static_cast<std::size_t>(h.variant.front() - 'x'));
      case Hypothesis::SearchStrategy::tip_mode:
        return tipModes(h.variant);
      case Hypothesis::SearchStrategy::spindle_order:
        return orders(h.coordinates.size());
    }
    return {};
  }

 private:
  Probes sensorModes(std::size_t axis) const {
    constexpr double DAMPING = 0.04;
    double rate = 0.0;
    for (const TestData& t : runner_.data().tests) rate = std::max(rate, t.test.sample_rate);
    Probes found;
    for (const double f : bestFrequencies(
             projection_, runner_, ModeProbes::grid(60.0, 0.42 * rate, 1.06),
             [&](const std::vector<double>& at) { return probes_.sensorModes(axis, at, DAMPING); }, false)) {
      const double d = std::log(DAMPING);
      found.push_back({{std::log(f), d, 0.0}, {{std::log(f), d, 0.01}}, false});
    }
    return found;
  }

  Probes tipModes(const std::string& axes) {
    constexpr double DAMPING = 0.05;
    Hypothesis::Probe probe;
    for (const char a : axes) {
      if (tip_.count(a) == 0) {
        tip_[a] = bestFrequencies(
            projection_, runner_, ModeProbes::grid(200.0, 6000.0, 1.08),
            [&](const std::vector<double>& at) { return probes_.tipModes(a == 'x' ? 0 : 1, at, DAMPING); },
            true);
      }
      const double f = tip_[a].empty() ? 1200.0 : tip_[a].front();
      for (const double v : {std::log(f), std::log(DAMPING), 0.0}) probe.null.push_back(v);
    }
    for (std::size_t k = 2; k < probe.null.size(); k += 3) addPoint(probe, k);
    return {probe};
  }

  // The order, then amplitudes.
  Probes orders(std::size_t coordinates) const {
    Probes found;
    for (const double order : bestOrders(runner_, model_, now_.residual, 2)) {
      Hypothesis::Probe probe;
      probe.null.assign(coordinates, 0.0);
      probe.null.front() = order;
      for (std::size_t k = 1; k < coordinates; ++k) addPoint(probe, k);
      found.push_back(probe);
    }
    return found;
  }

  static void addPoint(Hypothesis::Probe& probe, std::size_t coordinate) {
    probe.points.push_back(probe.null);
    probe.points.back()[coordinate] = 1.0;
  }

  const Projection& projection_;
  const TwinRunner& runner_;
  const MachineModel& model_;
  const FitResult& now_;
  const ModeProbes probes_;
  std::map<char, std::vector<double>> tip_;  // best frequencies of the tool's axes, computed once
};

// Change of the records by the points of a probe.
SparseColumns columnsOf(const Fitter& fitter, const FitState& state, const Hypothesis& h,
                        const Hypothesis::Probe& probe, const SimulatedChannels& base) {
  std::vector<MachineModel> models;
  for (const std::vector<double>& point : probe.points) {
    FitState with = state;
    with.members.push_back({&h, point});
    models.push_back(fitter.model(with));
  }
  return {fitter.runner(), base, fitter.runner().simulateChannels(models),
          std::vector<double>(models.size(), 1.0)};
}

// Start of a fit from amplitudes along a probe's points.
std::vector<double> startOf(const Hypothesis& h, const Hypothesis::Probe& probe,
                            const Eigen::VectorXd& amplitudes) {
  std::vector<double> start = probe.from_points ? probe.points.front() : probe.null;
  for (Index k = 0; k < amplitudes.size() && !probe.from_points; ++k) {
    for (std::size_t c = 0; c < start.size(); ++c)
      start[c] += amplitudes[k] * (probe.points[static_cast<std::size_t>(k)][c] - probe.null[c]);
  }
  for (std::size_t c = 0; c < start.size(); ++c)
    start[c] = std::clamp(start[c], h.coordinates[c].low, h.coordinates[c].high);
  return start;
}

}  // namespace

namespace {

// Largest gain by remembered derivatives; no value without any.
std::optional<double> rememberedGain(const Projection& projection, const Hypothesis& h,
                                     const ScreeningMemory& memory) {
  const auto found = memory.columns.find(&h);
  if (found == memory.columns.end()) return {};
  double gain = 0.0;
  for (const Eigen::MatrixXf& columns : found->second)
    gain = std::max(gain, projection.roughGain(columns.cast<double>()));
  return gain;
}

// @param columns receives the thinned derivatives of the probes
PredictedGain predictGain(const Fitter& fitter, const FitResult& now, const Projection& projection,
                          const Hypothesis& h, const std::vector<Hypothesis::Probe>& probes,
                          std::vector<Eigen::MatrixXf>* columns) {
  PredictedGain best;
  best.hypothesis = &h;
  for (const Hypothesis::Probe& probe : probes) {
    const SparseColumns change = columnsOf(fitter, now.state, h, probe, projection.base());
    if (!change.allFinite() || change.squares().sum() == 0.0) continue;
    if (columns) columns->push_back(projection.thinned().of(change).cast<float>());
    const Projection::Reduction reduction = projection.reduction(change);
    if (reduction.gain <= best.gain) continue;
    std::vector<double> start = startOf(h, probe, reduction.amplitudes);
    if (start == probe.null) continue;  // the optimum is outside the bounds
    best.gain = reduction.gain;
    best.independent_share = reduction.independent_share;
    best.start = std::move(start);
    best.prior_evidence = {};
    if (best.gain > ValidationResult::requiredSquares()) projection.addChange(change, reduction, &best);
    best.null = probe.from_points ? std::vector<double>{} : probe.null;
  }
  return best;
}

void sortByGain(std::vector<PredictedGain>* predictions) {
  std::stable_sort(predictions->begin(), predictions->end(),
                   [](const PredictedGain& a, const PredictedGain& b) { return a.gain > b.gain; });
}

}  // namespace

std::vector<PredictedGain> screen(const Fitter& fitter, const FitResult& now, const NominalTangents& tangents,
                                  const std::vector<Hypothesis>& hypotheses, double required_gain,
                                  ScreeningMemory* memory) {
  constexpr double MIN_SHARE = 0.1;
  const Projection projection(fitter, now, tangents);
  const MachineModel model = fitter.model(now.state);
  ProbeFinder finder(projection, fitter.runner(), model, now);
  struct Screened {
    const Hypothesis* hypothesis;
    std::vector<Hypothesis::Probe> probes;
    std::optional<std::vector<Eigen::MatrixXf>> columns;
    std::optional<PredictedGain> predicted;
  };
  const auto isBelowLimit = [&](const Hypothesis& h) {
    const auto most = memory->gain_limits.find(&h);
    return most != memory->gain_limits.end() && most->second < required_gain;
  };
  std::vector<Screened> screened;
  for (const Hypothesis& h : hypotheses) {
    if (fitter.cancelled()) break;
    if (hasMember(now.state, h.effect, h.variant) ||
        (!h.after.empty() && !hasMember(now.state, h.effect, h.after)))
      continue;
    screened.push_back({&h, {}, std::nullopt, std::nullopt});
    if (h.strategy != Hypothesis::SearchStrategy::none && !isBelowLimit(h))
      screened.back().probes = finder.probesOf(h);
  }
  runParallel(screened.size(), fitter.runner().threads(), [&](std::size_t k) {
    if (fitter.cancelled()) return;
    Screened& one = screened[k];
    const Hypothesis& h = *one.hypothesis;
    const bool below_limit = isBelowLimit(h);
    const std::optional<double> gain =
        below_limit ? memory->gain_limits.at(&h) : rememberedGain(projection, h, *memory);
    if (below_limit || (gain && *gain < MIN_SHARE * required_gain)) {
      one.predicted.emplace();
      one.predicted->hypothesis = &h;
      one.predicted->approximate = true;
      one.predicted->gain = *gain;
      return;
    }
    // Probes with a searched location change with the state.
    const bool remembered = h.strategy == Hypothesis::SearchStrategy::none;
    if (remembered) one.columns.emplace();
    one.predicted = predictGain(fitter, now, projection, h, remembered ? h.probes : one.probes,
                                remembered ? &*one.columns : nullptr);
  });
  memory->gain_limits.clear();
  std::vector<PredictedGain> predictions;
  for (Screened& one : screened) {
    if (one.columns) memory->columns[one.hypothesis] = std::move(*one.columns);
    if (one.predicted) predictions.push_back(std::move(*one.predicted));
  }
  sortByGain(&predictions);
  return predictions;
}

void screenRemembered(const Fitter& fitter, const FitResult& now, const NominalTangents& tangents,
                      double least, ScreeningMemory* memory, std::vector<PredictedGain>* predictions) {
  const Projection projection(fitter, now, tangents);
  const MachineModel model = fitter.model(now.state);
  ProbeFinder finder(projection, fitter.runner(), model, now);
  for (PredictedGain& p : *predictions) {
    if (!p.approximate || p.gain <= least || fitter.cancelled()) continue;
    const Hypothesis& h = *p.hypothesis;
    std::vector<Eigen::MatrixXf> columns;
    p = predictGain(fitter, now, projection, h, finder.probesOf(h), &columns);
    if (h.strategy == Hypothesis::SearchStrategy::none) memory->columns[&h] = std::move(columns);
  }
  sortByGain(predictions);
}

SparseColumns memberTangents(const Fitter& fitter, const FitState& state,
                             const std::vector<std::size_t>& members, SimulatedChannels* base) {
  std::vector<MachineModel> models{fitter.model(state)};
  std::vector<double> steps;
  for (const std::size_t m : members) {
    const std::vector<Coordinate>& coordinates = state.members[m].hypothesis->coordinates;
    for (std::size_t c = 0; c < coordinates.size(); ++c) {
      FitState moved = state;
      double& value = moved.members[m].values[c];
      const double step =
          value + coordinates[c].step > coordinates[c].high ? -coordinates[c].step : coordinates[c].step;
      value += step;
      steps.push_back(step);
      models.push_back(fitter.model(moved));
    }
  }
  auto simulated = fitter.runner().simulateChannels(models);
  *base = std::move(simulated.front());
  simulated.erase(simulated.begin());
  return {fitter.runner(), *base, simulated, steps};
}

EffectScale fittedScale(const Fitter& fitter, const PredictedGain& predicted) {
  if (!predicted.change) return effectScaleOf({});
  const Eigen::VectorXd residual = *predicted.baseline_residual - *predicted.change;
  std::vector<ScaleEvidence> tests =
      scaleEvidenceIn(fitter.runner(), predicted.change->data(), residual.data());
  tests.push_back(predicted.prior_evidence);
  const double variance = std::max(1.0, residual.squaredNorm() / static_cast<double>(residual.size()));
  tests.back().variance = variance * predicted.prior_evidence.squares;
  return effectScaleOf(tests);
}

std::optional<std::vector<double>> equivalentValues(const Fitter& fitter, const Member& member,
                                                    const Hypothesis& hypothesis) {
  const auto radii = [&](const EffectEntry& entry) {
    MachineModel model = fitter.runner().data().nominal;
    model.effects = {entry};
    const std::vector<double> offset = sim::setUpOf(model, sim::EffectSet(model)).radius_offset;
    return Eigen::VectorXd(
        Eigen::Map<const Eigen::VectorXd>(offset.data(), static_cast<Index>(offset.size())));
  };
  std::vector<double> values;
  for (const Coordinate& c : hypothesis.coordinates) values.push_back(c.null);
  const Eigen::VectorXd null = radii(hypothesis.entry(values));
  const Eigen::VectorXd target = radii(member.hypothesis->entry(member.values)) - null;
  if (target.size() == 0 || target.isZero(0.0)) return {};
  Eigen::MatrixXd columns(null.size(), static_cast<Index>(values.size()));
  for (std::size_t c = 0; c < values.size(); ++c) {
    std::vector<double> moved = values;
    moved[c] += hypothesis.coordinates[c].step;
    columns.col(static_cast<Index>(c)) =
        (radii(hypothesis.entry(moved)) - null) / hypothesis.coordinates[c].step;
  }
  if (columns.size() == 0 || (columns.colwise().squaredNorm().array() == 0.0).any()) return {};
  const Eigen::VectorXd found = linear::leastNorm(columns, target);
  for (std::size_t c = 0; c < values.size(); ++c)
    values[c] = std::clamp(values[c] + found[static_cast<Index>(c)], hypothesis.coordinates[c].low,
                           hypothesis.coordinates[c].high);
  return values;
}

std::vector<double> bestStart(const Fitter& fitter, const FitResult& now, const PredictedGain& predicted,
                              const std::optional<std::vector<double>>& other) {
  if (predicted.null.empty() && !other) return predicted.start;
  std::vector<std::vector<double>> starts{predicted.start};
  for (const double share : {0.5, 0.2, 0.05}) {
    if (predicted.null.empty()) break;
    std::vector<double> start = predicted.null;
    for (std::size_t c = 0; c < start.size(); ++c)
      start[c] += share * (predicted.start[c] - predicted.null[c]);
    starts.push_back(std::move(start));
  }
  if (other) starts.push_back(*other);
  std::vector<MachineModel> models;
  for (const std::vector<double>& start : starts) {
    FitState with = now.state;
    with.members.push_back({predicted.hypothesis, start});
    models.push_back(fitter.model(with));
  }
  const auto simulated = fitter.runner().simulate(models);
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < simulated.size(); ++k) {
    const double squares = residualSquares(fitter.runner(), simulated[k]);
    if (squares < least) {
      least = squares;
      best = k;
    }
  }
  return starts[best];
}

}  // namespace smartmill::discrepancy
