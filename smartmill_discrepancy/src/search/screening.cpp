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
#include "smartmill_sim/effects/effect.h"

namespace smartmill::discrepancy {
namespace {

using Eigen::Index;

// Some of the samples of a campaign, with weights that make up for the others: one in four, and all of what
// has few. Which one of the four is drawn, since at even distances a line would look like another.
class Thinned {
 public:
  explicit Thinned(const TwinRunner& runner) {
    constexpr std::size_t EVERY = 4, FEW = 256;
    std::minstd_rand random(1);
    for (const Block& b : runner.blocks()) {
      const std::size_t every = b.size < FEW ? 1 : EVERY;
      for (std::size_t i = 0; i + every <= b.size; i += every) {
        rows_.push_back(static_cast<Index>(b.offset + i + (every > 1 ? random() % every : 0)));
        weights_.push_back(std::sqrt(static_cast<double>(every)));
      }
    }
  }

  Eigen::VectorXd of(const Eigen::VectorXd& values) const { return weighted(values(rows_)); }
  Eigen::MatrixXd of(const BlockColumns& columns) const { return weighted(columns.rows(rows_)); }
  /// Of columns over these samples alone.
  Eigen::MatrixXd weighted(Eigen::MatrixXd few) const {
    few.array().colwise() *= weights().array();
    return few;
  }
  const std::vector<Index>& rows() const { return rows_; }

 private:
  Eigen::Map<const Eigen::VectorXd> weights() const {
    return {weights_.data(), static_cast<Index>(weights_.size())};
  }

  std::vector<Index> rows_;
  std::vector<double> weights_;
};

// Orthogonal projection off the nominal tangents (with their priors), off where the records lie, and off the
// tangents of the members.
class Projection {
 public:
  Projection(const Fitter& fitter, const Fit& now, const NominalTangents& tangents)
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
    for (std::size_t k = 0; k < tangents.turns.size(); ++k) {
      const auto at = static_cast<Index>(freedom_.size() + k);
      if (fitter.turns()[k].freedom.value == &Turn::entry && !now.state.turns.empty())
        pull_[at] = -now.state.turns[k] * prior_[at];
    }
    score_ = stacked(tangents.columns.along(residual_), members_.along(residual_)) + pull_;
    alone_ = withinBounds(information_, score_);
    Eigen::VectorXd left = residual_;
    move(-alone_.by, &left);
    left_ = std::make_shared<const Eigen::VectorXd>(std::move(left));
    thinOut();
  }

  const SimulatedBlocks& base() const { return base_; }
  const Thinned& thinned() const { return thinned_; }

  // What columns take away when all else moves with them.
  struct Taken {
    double gain = 0.0;  // [1] of chi2 and priors
    Eigen::VectorXd amplitudes;
    double apart = 1.0;  // [1] share of them that nothing else can stand for
    Eigen::VectorXd all_else;
  };
  Taken taken(const BlockColumns& columns) const {
    return taken(information_, score_, alone_.by, crossWith(columns), columns.gram(),
                 columns.along(residual_));
  }

  // What such a way changes of the simulation, beside the way without the columns.
  void addChange(const BlockColumns& columns, const Taken& taken, Promise* promise) const {
    auto change = std::make_shared<Eigen::VectorXd>(Eigen::VectorXd::Zero(residual_.size()));
    columns.addTo(taken.amplitudes, change.get());
    move(taken.all_else - alone_.by, change.get());
    promise->change = std::move(change);
    promise->left_without = left_;
    for (std::size_t c = 0; c < freedom_.size(); ++c) {
      const double by = taken.all_else[static_cast<Index>(c)];
      const double d = (by - alone_.by[static_cast<Index>(c)]) / freedom_[c].prior_std;
      promise->stated.squares += d * d;
      promise->stated.product -= d * (nominal_[c] + by - freedom_[c].null) / freedom_[c].prior_std;
    }
  }

  // About the same gain, from thinned columns.
  double roughGain(const Eigen::MatrixXd& columns) const {
    return taken(few_information_, few_score_, few_alone_, few_beside_.transpose() * columns,
                 columns.transpose() * columns, columns.transpose() * few_residual_)
        .gain;
  }

  // The same of each column by itself; 0 where it has no trace, no number, or a sign that cannot be.
  Eigen::VectorXd roughGains(const Eigen::MatrixXd& columns, bool positive) const {
    Eigen::MatrixXd cross = few_beside_.transpose() * columns;
    for (const Index c : alone_.held) cross.row(c).setZero();
    const Eigen::MatrixXd solved = linear::solveSymmetric(few_held_information_, cross);
    const Eigen::VectorXd raw = columns.colwise().squaredNorm();
    const Eigen::VectorXd own = raw - (cross.cwiseProduct(solved)).colwise().sum().transpose();
    const Eigen::VectorXd score = columns.transpose() * few_left_;
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

  Eigen::MatrixXd crossWith(const BlockColumns& columns) const {
    return stacked(tangents_.columns.cross(columns), members_.cross(columns));
  }

  // vector += what nominal values, turns and members do when they move.
  void move(const Eigen::VectorXd& by, Eigen::VectorXd* vector) const {
    tangents_.columns.addTo(by.head(tangents_.columns.cols()), vector);
    members_.addTo(by.tail(members_.cols()), vector);
  }

  static double taken(const Eigen::MatrixXd& information, const Eigen::VectorXd& score,
                      const Eigen::VectorXd& by) {
    return 2.0 * score.dot(by) - by.dot(information * by);
  }

  Taken taken(const Eigen::MatrixXd& information, const Eigen::VectorXd& score, const Eigen::VectorXd& alone,
              const Eigen::MatrixXd& cross, Eigen::MatrixXd own, const Eigen::VectorXd& along) const {
    const Index beside = information.rows(), count = own.rows();
    const double raw = own.trace();
    own.diagonal() = own.diagonal().array() * (1.0 + 1e-9) + 1e-30;
    Eigen::MatrixXd all(beside + count, beside + count);
    all << information, cross, cross.transpose(), own;
    Eigen::VectorXd right(beside + count);
    right << score, along;
    const Way way = withinBounds(all, right);
    Taken result;
    result.gain = taken(all, right, way.by) - taken(information, score, alone);
    result.amplitudes = way.by.tail(count);
    result.all_else = way.by.head(beside);
    const Eigen::MatrixXd held = heldAt(way.held, information);
    Eigen::MatrixXd free = cross;
    for (const Index c : way.held) free.row(c).setZero();
    result.apart = (own - free.transpose() * linear::solveSymmetric(held, free)).trace() / raw;
    return result;
  }

  // Tangents of the members' values beside the nominal ones.
  void addMembers(const Fitter& fitter, const FitState& state) {
    std::vector<std::size_t> all(state.members.size());
    std::iota(all.begin(), all.end(), 0u);
    members_ = memberTangents(fitter, state, all, &base_);
    const Index beside = tangents_.columns.cols();
    prior_.resize(beside + members_.cols());
    for (std::size_t k = 0; k < tangents_.turns.size(); ++k)
      prior_[static_cast<Index>(freedom_.size() + k)] = std::pow(fitter.turns()[k].freedom.prior_std, -2.0);
    for (std::size_t c = 0; c < freedom_.size(); ++c)
      prior_[static_cast<Index>(c)] = 1.0 / (freedom_[c].prior_std * freedom_[c].prior_std);
    prior_.tail(members_.cols()) = 1e-12 + 1e-9 * members_.squares().array();
  }

  // Where everything moves to, and the nominal values that their bounds keep.
  struct Way {
    Eigen::VectorXd by;
    std::vector<Index> held;
  };

  Eigen::MatrixXd heldAt(const std::vector<Index>& held, Eigen::MatrixXd information) const {
    for (const Index c : held) {
      information.row(c).setZero();
      information.col(c).setZero();
      information(c, c) = prior_[c];
    }
    return information;
  }

  // A value that would go over its bound stays there, one after the other, the furthest first: what is tried
  // may bring back one that stands there without it.
  Way withinBounds(const Eigen::MatrixXd& information, const Eigen::VectorXd& right) const {
    constexpr double AT_BOUND = 0.01;  // standard deviations
    Way way;
    Eigen::VectorXd at_bound = Eigen::VectorXd::Zero(right.size());
    for (;;) {
      Eigen::VectorXd score = right - information * at_bound;
      for (const Index c : way.held) score[c] = 0.0;
      way.by = linear::solveSymmetric(heldAt(way.held, information), score) + at_bound;
      double worst = AT_BOUND;
      Index which = -1;
      for (std::size_t k = 0; k < freedom_.size(); ++k) {
        const auto c = static_cast<Index>(k);
        if (std::find(way.held.begin(), way.held.end(), c) != way.held.end()) continue;
        const double to = nominal_[k] + way.by[c];
        const double beyond = std::max(freedom_[k].low - to, to - freedom_[k].high) / freedom_[k].prior_std;
        if (beyond <= worst) continue;
        worst = beyond;
        which = c;
      }
      if (which < 0) return way;
      const Coordinate& over = freedom_[static_cast<std::size_t>(which)];
      const double at = nominal_[static_cast<std::size_t>(which)];
      at_bound[which] = (way.by[which] > 0.0 ? over.high : over.low) - at;
      way.held.push_back(which);
    }
  }

  // What is left beside all that moves, thinned.
  void thinOut() {
    const Eigen::MatrixXd nominal = thinned_.of(tangents_.columns), members = thinned_.of(members_);
    few_beside_.resize(nominal.rows(), nominal.cols() + members.cols());
    few_beside_ << nominal, members;
    few_residual_ = thinned_.of(residual_);
    few_left_ = thinned_.of(*left_);
    few_information_.setZero(few_beside_.cols(), few_beside_.cols());
    if (few_beside_.size() > 0)
      few_information_.selfadjointView<Eigen::Lower>().rankUpdate(few_beside_.transpose());
    few_information_ = few_information_.selfadjointView<Eigen::Lower>();
    few_information_.diagonal() += prior_;
    few_held_information_ = heldAt(alone_.held, few_information_);
    few_score_ = few_beside_.transpose() * few_residual_ + pull_;
    few_alone_ = withinBounds(few_information_, few_score_).by;
  }

  const std::vector<Coordinate>& freedom_;
  const std::vector<double>& nominal_;
  const NominalTangents& tangents_;
  SimulatedBlocks base_;
  BlockColumns members_;
  Eigen::VectorXd prior_, residual_, pull_, score_;  // pull: of the priors, part of the score
  Eigen::MatrixXd information_;
  Way alone_;  // without what is tried
  std::shared_ptr<const Eigen::VectorXd> left_;
  Thinned thinned_;
  Eigen::MatrixXd few_beside_, few_information_, few_held_information_;
  Eigen::VectorXd few_residual_, few_left_, few_score_, few_alone_;
};

// The two best frequencies of a mode, one octave-third or more apart, from columns to first order.
std::vector<double> bestFrequencies(const Projection& projection, const TwinRunner& runner,
                                    const std::vector<double>& frequencies,
                                    const std::function<Eigen::MatrixXd(const std::vector<double>&)>& columns,
                                    bool positive) {
  constexpr std::size_t BATCH = 8;  // one pass over the tangents serves so many
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

// Where to try an effect of which nobody knows the place: frequency of a mode, order of a line.
class Seeker {
 public:
  using Probes = std::vector<Hypothesis::Probe>;

  Seeker(const Projection& projection, const TwinRunner& runner, const MachineModel& model, const Fit& now)
      : projection_(projection),
        runner_(runner),
        model_(model),
        now_(now),
        probes_(runner, model, projection.thinned().rows()) {}

  Probes probesOf(const Hypothesis& h) {
    switch (h.seek) {
      case Hypothesis::Seek::nothing:
        return h.probes;
      case Hypothesis::Seek::sensor_mode:
        return sensorModes(static_cast<std::size_t>(h.variant.front() - 'x'));
      case Hypothesis::Seek::tip_mode:
        return tipModes(h.variant);
      case Hypothesis::Seek::spindle_order:
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

  // The order, then sizes.
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
  const Fit& now_;
  const ModeProbes probes_;
  std::map<char, std::vector<double>> tip_;  // best frequencies of the tool's axes, once found
};

bool isMember(const FitState& state, const std::string& effect, const std::string& variant) {
  return std::any_of(state.members.begin(), state.members.end(), [&](const Member& m) {
    return m.hypothesis->effect == effect && m.hypothesis->variant == variant;
  });
}

// What the points of a probe add to the records.
BlockColumns columnsOf(const Fitter& fitter, const FitState& state, const Hypothesis& h,
                       const Hypothesis::Probe& probe, const SimulatedBlocks& base) {
  std::vector<MachineModel> models;
  for (const std::vector<double>& point : probe.points) {
    FitState with = state;
    with.members.push_back({&h, point});
    models.push_back(fitter.model(with));
  }
  return {fitter.runner(), base, fitter.runner().simulateBlocks(models),
          std::vector<double>(models.size(), 1.0)};
}

// Where a fit begins that has these amplitudes along a probe's points.
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

// The most that a hypothesis promises by what it did when it was simulated last; no number: it was not.
std::optional<double> rememberedGain(const Projection& projection, const Hypothesis& h,
                                     const ScreeningMemory& memory) {
  const auto found = memory.did.find(&h);
  if (found == memory.did.end()) return {};
  double gain = 0.0;
  for (const Eigen::MatrixXf& columns : found->second)
    gain = std::max(gain, projection.roughGain(columns.cast<double>()));
  return gain;
}

// @param did receives what the probes do, thinned out
Promise promiseOf(const Fitter& fitter, const Fit& now, const Projection& projection, const Hypothesis& h,
                  const std::vector<Hypothesis::Probe>& probes, std::vector<Eigen::MatrixXf>* did) {
  Promise best;
  best.hypothesis = &h;
  for (const Hypothesis::Probe& probe : probes) {
    const BlockColumns columns = columnsOf(fitter, now.state, h, probe, projection.base());
    if (!columns.allFinite() || columns.squares().sum() == 0.0) continue;
    if (did) did->push_back(projection.thinned().of(columns).cast<float>());
    const Projection::Taken taken = projection.taken(columns);
    if (taken.gain <= best.gain) continue;
    std::vector<double> start = startOf(h, probe, taken.amplitudes);
    if (start == probe.null) continue;  // the data ask for what cannot be
    best.gain = taken.gain;
    best.apart = taken.apart;
    best.start = std::move(start);
    best.stated = {};
    if (best.gain > Standing::tellingSquares()) projection.addChange(columns, taken, &best);
    best.null = probe.from_points ? std::vector<double>{} : probe.null;
  }
  return best;
}

void sortByGain(std::vector<Promise>* promises) {
  std::stable_sort(promises->begin(), promises->end(),
                   [](const Promise& a, const Promise& b) { return a.gain > b.gain; });
}

}  // namespace

std::vector<Promise> screen(const Fitter& fitter, const Fit& now, const NominalTangents& tangents,
                            const std::vector<Hypothesis>& tried, double due, ScreeningMemory* memory) {
  constexpr double NOWHERE_NEAR = 0.1;
  const Projection projection(fitter, now, tangents);
  const MachineModel model = fitter.model(now.state);
  Seeker seeker(projection, fitter.runner(), model, now);
  struct Look {
    const Hypothesis* hypothesis;
    std::vector<Hypothesis::Probe> probes;
    std::optional<std::vector<Eigen::MatrixXf>> did;
    std::optional<Promise> promise;
  };
  const auto inVain = [&](const Hypothesis& h) {
    const auto most = memory->at_most.find(&h);
    return most != memory->at_most.end() && most->second < due;
  };
  std::vector<Look> looks;
  for (const Hypothesis& h : tried) {
    if (fitter.cancelled()) break;
    if (isMember(now.state, h.effect, h.variant) ||
        (!h.after.empty() && !isMember(now.state, h.effect, h.after)))
      continue;
    looks.push_back({&h, {}, std::nullopt, std::nullopt});
    if (h.seek != Hypothesis::Seek::nothing && !inVain(h)) looks.back().probes = seeker.probesOf(h);
  }
  runParallel(looks.size(), fitter.runner().threads(), [&](std::size_t k) {
    if (fitter.cancelled()) return;
    Look& look = looks[k];
    const Hypothesis& h = *look.hypothesis;
    const bool in_vain = inVain(h);
    const std::optional<double> gain =
        in_vain ? memory->at_most.at(&h) : rememberedGain(projection, h, *memory);
    if (in_vain || (gain && *gain < NOWHERE_NEAR * due)) {
      look.promise.emplace();
      look.promise->hypothesis = &h;
      look.promise->rough = true;
      look.promise->gain = *gain;
      return;
    }
    // What is to be sought lies elsewhere each time.
    const bool remembered = h.seek == Hypothesis::Seek::nothing;
    if (remembered) look.did.emplace();
    look.promise = promiseOf(fitter, now, projection, h, remembered ? h.probes : look.probes,
                             remembered ? &*look.did : nullptr);
  });
  memory->at_most.clear();
  std::vector<Promise> promises;
  for (Look& look : looks) {
    if (look.did) memory->did[look.hypothesis] = std::move(*look.did);
    if (look.promise) promises.push_back(std::move(*look.promise));
  }
  sortByGain(&promises);
  return promises;
}

void screenRough(const Fitter& fitter, const Fit& now, const NominalTangents& tangents, double least,
                 ScreeningMemory* memory, std::vector<Promise>* promises) {
  const Projection projection(fitter, now, tangents);
  const MachineModel model = fitter.model(now.state);
  Seeker seeker(projection, fitter.runner(), model, now);
  for (Promise& p : *promises) {
    if (!p.rough || p.gain <= least || fitter.cancelled()) continue;
    const Hypothesis& h = *p.hypothesis;
    std::vector<Eigen::MatrixXf> did;
    p = promiseOf(fitter, now, projection, h, seeker.probesOf(h), &did);
    if (h.seek == Hypothesis::Seek::nothing) memory->did[&h] = std::move(did);
  }
  sortByGain(promises);
}

BlockColumns memberTangents(const Fitter& fitter, const FitState& state,
                            const std::vector<std::size_t>& members, SimulatedBlocks* base) {
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
  auto simulated = fitter.runner().simulateBlocks(models);
  *base = std::move(simulated.front());
  simulated.erase(simulated.begin());
  return {fitter.runner(), *base, simulated, steps};
}

AskedShare fittedShare(const Fitter& fitter, const Promise& promise) {
  if (!promise.change) return sharedBy({});
  const Eigen::VectorXd left = *promise.left_without - *promise.change;
  std::vector<AskedTest> tests = askedIn(fitter.runner(), promise.change->data(), left.data());
  tests.push_back(promise.stated);
  const double variance = std::max(1.0, left.squaredNorm() / static_cast<double>(left.size()));
  tests.back().variance = variance * promise.stated.squares;
  return sharedBy(tests);
}

std::optional<std::vector<double>> inPlaceOf(const Fitter& fitter, const Member& member,
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
  const Eigen::VectorXd wanted = radii(member.hypothesis->entry(member.values)) - null;
  if (wanted.size() == 0 || wanted.isZero(0.0)) return {};
  Eigen::MatrixXd columns(null.size(), static_cast<Index>(values.size()));
  for (std::size_t c = 0; c < values.size(); ++c) {
    std::vector<double> moved = values;
    moved[c] += hypothesis.coordinates[c].step;
    columns.col(static_cast<Index>(c)) =
        (radii(hypothesis.entry(moved)) - null) / hypothesis.coordinates[c].step;
  }
  if (columns.size() == 0 || (columns.colwise().squaredNorm().array() == 0.0).any()) return {};
  const Eigen::VectorXd found = linear::leastNorm(columns, wanted);
  for (std::size_t c = 0; c < values.size(); ++c)
    values[c] = std::clamp(values[c] + found[static_cast<Index>(c)], hypothesis.coordinates[c].low,
                           hypothesis.coordinates[c].high);
  return values;
}

std::vector<double> bestStart(const Fitter& fitter, const Fit& now, const Promise& promise,
                              const std::optional<std::vector<double>>& other) {
  if (promise.null.empty() && !other) return promise.start;
  std::vector<std::vector<double>> starts{promise.start};
  for (const double share : {0.5, 0.2, 0.05}) {
    if (promise.null.empty()) break;
    std::vector<double> start = promise.null;
    for (std::size_t c = 0; c < start.size(); ++c) start[c] += share * (promise.start[c] - promise.null[c]);
    starts.push_back(std::move(start));
  }
  if (other) starts.push_back(*other);
  std::vector<MachineModel> models;
  for (const std::vector<double>& start : starts) {
    FitState with = now.state;
    with.members.push_back({promise.hypothesis, start});
    models.push_back(fitter.model(with));
  }
  const auto simulated = fitter.runner().simulate(models);
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < simulated.size(); ++k) {
    const double squares = squaresLeft(fitter.runner(), simulated[k]);
    if (squares < least) {
      least = squares;
      best = k;
    }
  }
  return starts[best];
}

}  // namespace smartmill::discrepancy
