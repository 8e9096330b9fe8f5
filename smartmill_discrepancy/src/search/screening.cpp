#include "smartmill_discrepancy/search/screening.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <utility>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_discrepancy/search/mode_probes.h"
#include "smartmill_discrepancy/search/order_probes.h"

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
    size_ = static_cast<Index>(runner.size());
  }

  Eigen::VectorXd of(const Eigen::Ref<const Eigen::VectorXd>& values) const {
    const Eigen::Map<const Eigen::VectorXd> weights(weights_.data(), static_cast<Index>(weights_.size()));
    return values(rows_).cwiseProduct(weights);
  }
  Eigen::VectorXd of(const std::vector<double>& values) const {
    return of(Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Index>(values.size())));
  }
  Eigen::MatrixXd of(const BlockColumns& columns) const {
    Eigen::MatrixXd few(static_cast<Index>(rows_.size()), columns.cols());
    for (Index k = 0; k < columns.cols(); ++k) {
      Eigen::VectorXd column = Eigen::VectorXd::Zero(size_);
      columns.addTo(Eigen::VectorXd::Unit(columns.cols(), k), &column);
      few.col(k) = of(column);
    }
    return few;
  }

 private:
  std::vector<Index> rows_;
  std::vector<double> weights_;
  Index size_ = 0;
};

// Orthogonal projection off the nominal tangents (with their priors), off where the records lie, and off the
// tangents of the members.
class Projection {
 public:
  Projection(const Fitter& fitter, const Fit& now, const NominalTangents& tangents)
      : freedom_(fitter.freedom().coordinates()),
        nominal_(now.state.nominal),
        tangents_(tangents),
        held_(freedom_.size(), false),
        residual_(Eigen::Map<const Eigen::VectorXd>(now.residual.data(),
                                                    static_cast<Index>(fitter.runner().size()))),
        thinned_(fitter.runner()) {
    addMembers(fitter, now.state);
    information_.resize(prior_.size(), prior_.size());
    information_.leftCols(tangents.columns.cols()) =
        stacked(tangents.information, members_.cross(tangents.columns));
    information_.rightCols(members_.cols()) = stacked(tangents.columns.cross(members_), members_.gram());
    information_.diagonal() += prior_;
    Eigen::VectorXd right = stacked(tangents.columns.along(residual_), members_.along(residual_));
    for (std::size_t c = 0; c < freedom_.size(); ++c)
      right[static_cast<Index>(c)] -= nominal_[c] * prior_[static_cast<Index>(c)];
    for (std::size_t k = 0; k < tangents.turns.size(); ++k) {
      const auto at = static_cast<Index>(freedom_.size() + k);
      if (fitter.turns()[k].freedom.value == &Turn::entry && !now.state.turns.empty())
        right[at] -= now.state.turns[k] * prior_[at];
    }
    solveWithinBounds(right);
    thinOut();
  }

  const SimulatedBlocks& base() const { return base_; }
  const Thinned& thinned() const { return thinned_; }

  // Chi2 that these columns take away, with the amplitudes that do it. @param apart receives the share of
  // them that nothing else can stand for
  double gain(const BlockColumns& columns, Eigen::VectorXd* amplitudes, double* apart) const {
    const Eigen::MatrixXd cross = crossWith(columns);
    const Eigen::MatrixXd solved = linear::solveSymmetric(information_, cross);
    Eigen::MatrixXd own = columns.gram() - cross.transpose() * solved;
    const Eigen::VectorXd raw = columns.squares();
    *apart = own.trace() / raw.sum();
    for (Index k = 0; k < own.rows(); ++k) own(k, k) += 1e-9 * raw[k] + 1e-30;
    const Eigen::VectorXd score = columns.along(residual_) - cross.transpose() * solved_residual_;
    *amplitudes = linear::solveSymmetric(own, score);
    return score.dot(*amplitudes);
  }

  // About the same, from thinned columns.
  double roughGain(const Eigen::MatrixXd& columns) const {
    const Eigen::MatrixXd cross = few_beside_.transpose() * columns;
    Eigen::MatrixXd own =
        columns.transpose() * columns - cross.transpose() * linear::solveSymmetric(few_information_, cross);
    const Eigen::VectorXd raw = columns.colwise().squaredNorm();
    for (Index k = 0; k < own.rows(); ++k) own(k, k) += 1e-9 * raw[k] + 1e-30;
    const Eigen::VectorXd score = columns.transpose() * few_left_;
    return score.dot(linear::solveSymmetric(own, score));
  }

  // The same of each column by itself; 0 where it has no trace, no number, or a sign that cannot be.
  Eigen::VectorXd roughGains(const Eigen::MatrixXd& columns, bool positive) const {
    const Eigen::MatrixXd cross = few_beside_.transpose() * columns;
    const Eigen::MatrixXd solved = linear::solveSymmetric(few_information_, cross);
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
    Eigen::MatrixXd cross = stacked(tangents_.columns.cross(columns), members_.cross(columns));
    for (std::size_t c = 0; c < held_.size(); ++c) {
      if (held_[c]) cross.row(static_cast<Index>(c)).setZero();
    }
    return cross;
  }

  // Tangents of the members' values beside the nominal ones.
  void addMembers(const Fitter& fitter, const FitState& state) {
    std::vector<MachineModel> models{fitter.model(state)};
    std::vector<double> steps;
    for (std::size_t m = 0; m < state.members.size(); ++m) {
      const auto& coordinates = state.members[m].hypothesis->coordinates;
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
    base_ = std::move(simulated.front());
    simulated.erase(simulated.begin());
    members_ = BlockColumns(fitter.runner(), base_, simulated, steps);
    const Index beside = tangents_.columns.cols();
    prior_.resize(beside + members_.cols());
    for (std::size_t k = 0; k < tangents_.turns.size(); ++k)
      prior_[static_cast<Index>(freedom_.size() + k)] = std::pow(fitter.turns()[k].freedom.prior_std, -2.0);
    for (std::size_t c = 0; c < freedom_.size(); ++c)
      prior_[static_cast<Index>(c)] = 1.0 / (freedom_[c].prior_std * freedom_[c].prior_std);
    prior_.tail(members_.cols()) = 1e-12 + 1e-9 * members_.squares().array();
  }

  // One that stands at its bound moves no further, nor does one that the rest would push over it.
  void solveWithinBounds(Eigen::VectorXd& right) {
    constexpr double AT_BOUND = 0.01;  // standard deviations
    const auto hold = [&](std::size_t coordinate) {
      const auto c = static_cast<Index>(coordinate);
      held_[coordinate] = true;
      information_.row(c).setZero();
      information_.col(c).setZero();
      information_(c, c) = prior_[c];
      right[c] = 0.0;
    };
    for (std::size_t c = 0; c < freedom_.size(); ++c) {
      const double room = std::min(nominal_[c] - freedom_[c].low, freedom_[c].high - nominal_[c]);
      if (room < AT_BOUND * freedom_[c].prior_std) hold(c);
    }
    for (;;) {
      solved_residual_ = linear::solveSymmetric(information_, right);
      double worst = AT_BOUND;
      std::size_t which = freedom_.size();
      for (std::size_t c = 0; c < freedom_.size(); ++c) {
        const double at = nominal_[c] + solved_residual_[static_cast<Index>(c)];
        const double beyond = std::max(freedom_[c].low - at, at - freedom_[c].high) / freedom_[c].prior_std;
        if (held_[c] || beyond <= worst) continue;
        worst = beyond;
        which = c;
      }
      if (which == freedom_.size()) return;
      hold(which);
    }
  }

  // What is left beside all that moves, thinned.
  void thinOut() {
    const Eigen::MatrixXd nominal = thinned_.of(tangents_.columns), members = thinned_.of(members_);
    few_beside_.resize(nominal.rows(), nominal.cols() + members.cols());
    few_beside_ << nominal, members;
    for (std::size_t c = 0; c < held_.size(); ++c) {
      if (held_[c]) few_beside_.col(static_cast<Index>(c)).setZero();
    }
    few_left_ = thinned_.of(residual_) - few_beside_ * solved_residual_;
    few_information_ = few_beside_.transpose() * few_beside_;
    few_information_.diagonal() += prior_;
  }

  const std::vector<Coordinate>& freedom_;
  const std::vector<double>& nominal_;
  const NominalTangents& tangents_;
  SimulatedBlocks base_;
  BlockColumns members_;
  std::vector<bool> held_;  // nominal values that do not move
  Eigen::VectorXd prior_, residual_, solved_residual_;
  Eigen::MatrixXd information_;
  Thinned thinned_;
  Eigen::MatrixXd few_beside_, few_information_;
  Eigen::VectorXd few_left_;
};

// The two best frequencies of a mode, one octave-third or more apart, from columns to first order.
std::vector<double> bestFrequencies(const Projection& projection, const TwinRunner& runner,
                                    const std::vector<double>& frequencies,
                                    const std::function<std::vector<double>(double)>& column, bool positive) {
  constexpr std::size_t BATCH = 8;  // one pass over the tangents serves so many
  std::vector<double> gains(frequencies.size(), 0.0);
  runParallel((frequencies.size() + BATCH - 1) / BATCH, runner.threads(), [&](std::size_t batch) {
    const std::size_t first = batch * BATCH, count = std::min(BATCH, frequencies.size() - first);
    std::vector<Eigen::VectorXd> few;
    for (std::size_t k = 0; k < count; ++k)
      few.push_back(projection.thinned().of(column(frequencies[first + k])));
    Eigen::MatrixXd columns(few.front().size(), static_cast<Index>(count));
    for (std::size_t k = 0; k < count; ++k) columns.col(static_cast<Index>(k)) = few[k];
    const Eigen::VectorXd each = projection.roughGains(columns, positive);
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
      : projection_(projection), runner_(runner), model_(model), now_(now), probes_(runner, model) {}

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
             [&](double at) { return probes_.sensorMode(axis, at, DAMPING); }, false)) {
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
            [&](double at) { return probes_.tipMode(a == 'x' ? 0 : 1, at, DAMPING); }, true);
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
  const auto found = memory.find(&h);
  if (found == memory.end()) return {};
  double gain = 0.0;
  for (const Eigen::MatrixXf& columns : found->second)
    gain = std::max(gain, projection.roughGain(columns.cast<double>()));
  return gain;
}

Promise promiseOf(const Fitter& fitter, const Fit& now, const Projection& projection, Seeker& seeker,
                  const Hypothesis& h, ScreeningMemory* memory) {
  Promise best;
  best.hypothesis = &h;
  std::vector<Eigen::MatrixXf>& did = (*memory)[&h];
  did.clear();
  for (const Hypothesis::Probe& probe : seeker.probesOf(h)) {
    const BlockColumns columns = columnsOf(fitter, now.state, h, probe, projection.base());
    if (!columns.allFinite() || columns.squares().sum() == 0.0) continue;
    did.push_back(projection.thinned().of(columns).cast<float>());
    Eigen::VectorXd amplitudes;
    double apart = 1.0;
    const double gain = projection.gain(columns, &amplitudes, &apart);
    if (gain <= best.gain) continue;
    std::vector<double> start = startOf(h, probe, amplitudes);
    if (start == probe.null) continue;  // the data ask for what cannot be
    best.gain = gain;
    best.apart = apart;
    best.start = std::move(start);
    best.null = probe.from_points ? std::vector<double>{} : probe.null;
  }
  return best;
}

}  // namespace

std::vector<Promise> screen(const Fitter& fitter, const Fit& now, const NominalTangents& tangents,
                            const std::vector<Hypothesis>& tried, double due, ScreeningMemory* memory) {
  constexpr double NOWHERE_NEAR = 0.1;
  const Projection projection(fitter, now, tangents);
  const MachineModel model = fitter.model(now.state);
  Seeker seeker(projection, fitter.runner(), model, now);
  std::vector<Promise> promises;
  for (const Hypothesis& h : tried) {
    if (fitter.cancelled()) break;
    if (isMember(now.state, h.effect, h.variant) ||
        (!h.after.empty() && !isMember(now.state, h.effect, h.after)))
      continue;
    // What is to be sought lies elsewhere each time.
    if (h.seek == Hypothesis::Seek::nothing) {
      const std::optional<double> gain = rememberedGain(projection, h, *memory);
      if (gain && *gain < NOWHERE_NEAR * due) {
        Promise rough;
        rough.hypothesis = &h;
        rough.gain = *gain;
        promises.push_back(std::move(rough));
        continue;
      }
    }
    promises.push_back(promiseOf(fitter, now, projection, seeker, h, memory));
  }
  std::stable_sort(promises.begin(), promises.end(),
                   [](const Promise& a, const Promise& b) { return a.gain > b.gain; });
  return promises;
}

std::vector<double> bestStart(const Fitter& fitter, const Fit& now, const Promise& promise) {
  if (promise.null.empty()) return promise.start;
  std::vector<std::vector<double>> starts;
  std::vector<MachineModel> models;
  for (const double share : {1.0, 0.5, 0.2, 0.05}) {
    std::vector<double> start = promise.null;
    for (std::size_t c = 0; c < start.size(); ++c) start[c] += share * (promise.start[c] - promise.null[c]);
    FitState with = now.state;
    with.members.push_back({promise.hypothesis, start});
    starts.push_back(std::move(start));
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
