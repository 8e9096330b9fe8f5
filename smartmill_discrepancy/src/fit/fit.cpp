#include "smartmill_discrepancy/fit/fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "fit/campaign_cost.h"
#include "fit/tangent.h"
#include "smartmill_core/error.h"
#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_discrepancy/gap/asked.h"

namespace smartmill::discrepancy {
namespace {

using Values = std::vector<double>;
using Eigen::Index;
using Eigen::MatrixXd;

// Ends a fit that is through: what a step gains is a trifle beside what is above the noise, steps in a row
// gain nothing, or it comes too slowly near what it has to beat.
class Course {
 public:
  Course(const FitOptions& options, double samples) : options_(options), samples_(samples) {}

  bool goesOn(const fit::Progress& now) {
    constexpr int IN_VAIN = 4, PATIENCE = 3;
    const double gain = before_ - now.squares;
    before_ = now.squares;
    in_vain_ = gain > 0.0 ? 0 : in_vain_ + 1;
    if (now.iteration == 0) return true;
    const bool trifle = gain > 0.0 && gain < least(now.squares);
    const bool hopeless = now.iteration >= PATIENCE && now.squares - options_.to_beat > HOPE * gain;
    return !trifle && !hopeless && in_vain_ < IN_VAIN;
  }
  bool mayBeat(double squares, double promised) const {
    return promised >= least(squares) && squares - HOPE * promised <= options_.to_beat;
  }

 private:
  static constexpr double HOPE = 10.0;  // times what a step gains or promises, that later ones may bring
  double least(double squares) const {
    return options_.tolerance * std::min(std::max(squares - samples_, 20.0), squares);
  }
  const FitOptions& options_;
  double samples_, before_ = std::numeric_limits<double>::infinity();
  int in_vain_ = 0;
};

// Damped steps, which cross what is curved. Where nominal values are simulated undamped ones follow: an
// effect beside the nominal value that it resembles leaves a narrow valley, in which damping would creep.
// @return no value: the twin gives no numbers at the start
std::optional<Eigen::VectorXd> solve(const CampaignCost& cost, const FitOptions& options, double samples,
                                     const std::function<bool()>& cancelled) {
  constexpr int EASILY = 2;  // times the steps where each simulates little
  if (options.iterations == 0) return cost.start();
  fit::Options solver;
  solver.name = "fit of a campaign";
  solver.iterations = cost.simulatesAll() ? options.iterations : EASILY * options.iterations;
  solver.function_tolerance = 1e-15;  // Course ends it
  solver.parameter_tolerance = 1e-7;
  solver.dear_derivatives = true;
  solver.finish_at_bounds = false;  // simulations are dear, and the next round comes back
  std::vector<fit::Parameter> parameters = cost.parameters();
  Eigen::VectorXd own(static_cast<Index>(parameters.size()));
  const std::vector<double> radii =
      cost.simulatesAll() ? std::vector<double>{1e4, 1e10} : std::vector<double>{1e5};
  for (const double radius : radii) {
    Course course(options, samples);
    solver.progress = [&](const fit::Progress& now) {
      return course.goesOn(now) && !(cancelled && cancelled());
    };
    solver.trust_radius = radius;
    fit::Result result;
    try {
      result = fit::minimise(cost, parameters, solver);
    } catch (const Error&) {
      return {};
    }
    if (!result.usable()) return {};
    own = result.value;
    for (std::size_t c = 0; c < parameters.size(); ++c) parameters[c].start = own[static_cast<Index>(c)];
    if (radius == radii.back() || !course.mayBeat(result.squares, cost.promisedAt(own))) break;
  }
  return cost.pointAt(own);
}

// Inverse of the information with priors.
MatrixXd inverseAt(const CampaignCost& cost, MatrixXd information) {
  for (Index c = 0; c < information.cols(); ++c)
    information(c, c) += cost.precision(static_cast<std::size_t>(c));
  return linear::inverseSymmetric(information);
}

// [1] Of the variance, which an estimate of it with so many degrees of freedom passes in one of twenty
// (Wilson and Hilferty 1931).
double scatterByChance(double freedom) {
  const double spread = 2.0 / (9.0 * freedom);
  return std::pow(1.0 - spread + 1.645 * std::sqrt(spread), 3);
}

// Variance of influence.residual over all tests.
double pulledVariance(const TwinRunner& runner, const Eigen::VectorXd& influence,
                      const Eigen::VectorXd& residual, const std::vector<Values>& power) {
  std::map<std::size_t, AskedTest> by_test;
  for (std::size_t b = 0; b < power.size(); ++b) {
    const Block& block = runner.blocks()[b];
    by_test[block.test].add(influence.data() + block.offset, residual.data() + block.offset, block.size,
                            power[b]);
  }
  std::vector<AskedTest> tests;
  double squares = 0.0;
  for (const auto& [test, asked] : by_test) {
    tests.push_back(asked);
    squares += asked.squares;
  }
  const double within = std::max(squares, varianceOfLines(tests));
  const Scatter scatter = scatterOf(tests);
  const double freedom = std::max(scatter.freedom, 1.0);
  if (scatter.variance < scatterByChance(freedom) * within) return std::max(within, scatter.variance);
  // Each test has an error of its own, of which a few tests tell the size but poorly.
  const double student = studentOverNormal(freedom);
  return student * student * scatter.variance;
}

// Cost, residual and covariance at a point. @return false: no numbers there
bool describe(const CampaignCost& cost, const Eigen::VectorXd& at, double samples, std::size_t records,
              Fit& fit) {
  const CampaignCost::Linear* point = cost.linearise(at);
  if (!point) return false;
  fit.state = cost.stateAt(at);
  const Eigen::VectorXd residual = cost.residual(at);
  fit.chi2 = residual.squaredNorm();
  fit.residual.resize(static_cast<std::size_t>(residual.size()));
  Eigen::Map<Eigen::VectorXd>(fit.residual.data(), residual.size()) = -residual;
  fit.penalty = cost.penaltyAt(at);
  fit.bic = fit.chi2 + fit.penalty;
  const auto of_records = static_cast<double>(records);
  for (const Member& m : fit.state.members) {
    fit.bic += static_cast<double>(m.values.size()) * std::log(samples) + m.hypothesis->handicap;
    fit.bic += m.hypothesis->found_in_each_record * of_records * std::log(samples / of_records);
  }
  fit.covariance = inverseAt(cost, point->information);
  return true;
}

}  // namespace

FitState without(const FitState& state, std::size_t member) {
  FitState less = state;
  less.members.erase(less.members.begin() + static_cast<std::ptrdiff_t>(member));
  return less;
}

Fitter::Fitter(const TwinRunner& runner, const NominalFreedom& freedom, std::function<bool()> cancelled)
    : runner_(runner), freedom_(freedom), cancelled_(std::move(cancelled)) {
  for (std::size_t k = 0; k < runner.tests().size(); ++k) {
    for (const TurnFreedom& free : turnFreedoms(runner.data().tests[runner.tests()[k]]))
      turns_.push_back({k, free});
  }
}

NominalTangents NominalTangents::ofTurns() const {
  const auto count = static_cast<Index>(turns.size());
  return {{}, turns, columns.right(count), information.bottomRightCorner(count, count)};
}

MachineModel Fitter::model(const FitState& state) const {
  MachineModel model = freedom_.apply(runner_.data().nominal, state.nominal);
  for (const Member& m : state.members) model.effects.push_back(m.hypothesis->entry(m.values));
  return model;
}

NominalTangents Fitter::nominalTangents(const FitState& state) const {
  const std::vector<Coordinate>& coordinates = freedom_.coordinates();
  std::vector<MachineModel> models{model(state)};
  Values steps;
  for (std::size_t c = 0; c < coordinates.size(); ++c) {
    FitState moved = state;
    steps.push_back(TANGENT * coordinates[c].step);
    moved.nominal[c] += steps.back();
    models.push_back(model(moved));
  }
  std::vector<SimulatedBlocks> simulated = runner_.simulateBlocks(models);
  const SimulatedBlocks base = std::move(simulated.front());
  simulated.erase(simulated.begin());
  simulated.resize(coordinates.size() + turns_.size());
  for (const TurnOf& t : turns_) steps.push_back(t.freedom.step);
  runParallel(turns_.size(), runner_.threads(), [&](std::size_t k) {
    Turn by;
    by.*turns_[k].freedom.value = turns_[k].freedom.step;
    simulated[coordinates.size() + k] = runner_.turned(models.front(), base, turns_[k].chosen, by);
  });
  NominalTangents tangents{state.nominal, state.turns, BlockColumns(runner_, base, simulated, steps), {}};
  tangents.turns.resize(turns_.size(), 0.0);
  tangents.information = tangents.columns.gram();
  return tangents;
}

Fit Fitter::fit(const FitState& start, const NominalTangents* frozen, const FitOptions& options) const {
  const CampaignCost cost(*this, start, frozen, options);
  const double samples = runner_.counts();
  Fit fit;
  const std::optional<Eigen::VectorXd> at = solve(cost, options, samples, cancelled_);
  fit.converged = at && describe(cost, *at, samples, runner_.tests().size(), fit);
  if (!fit.converged) {
    fit.state = start;
    fit.chi2 = fit.bic = std::numeric_limits<double>::infinity();
  }
  return fit;
}

std::optional<FitState> Fitter::straightOn(const FitState& state, const NominalTangents& tangents,
                                           double prior_weight) const {
  FitOptions options;
  options.prior_weight = prior_weight;
  const CampaignCost cost(*this, state, &tangents, options);
  const std::optional<Eigen::VectorXd> at = cost.straightOn(cost.start());
  return at ? std::optional<FitState>(cost.stateAt(*at)) : std::nullopt;
}

double Fitter::penalty(const FitState& state, double prior_weight) const {
  FitOptions options;
  options.prior_weight = prior_weight;
  const CampaignCost cost(*this, state, nullptr, options);
  return cost.penaltyAt(cost.start());
}

MatrixXd Fitter::sandwichCovariance(const FitState& state, const NominalTangents& tangents,
                                    double prior_weight) const {
  FitOptions options;
  options.prior_weight = prior_weight;
  const CampaignCost cost(*this, state, &tangents, options);
  const Eigen::VectorXd& at = cost.start();
  Eigen::VectorXd std_dev(at.size());
  const CampaignCost::Linear* point = cost.linearise(at);
  if (!point) return {};
  const MatrixXd inverse = inverseAt(cost, point->information);
  const Eigen::VectorXd residual = cost.residual(at);
  const std::vector<Block>& blocks = runner_.blocks();
  std::vector<Values> power(blocks.size());
  runParallel(blocks.size(), runner_.threads(),
              [&](std::size_t b) { power[b] = powerOf(residual.data() + blocks[b].offset, blocks[b].size); });
  runParallel(cost.coordinates().size(), runner_.threads(), [&](std::size_t coordinate) {
    const auto c = static_cast<Index>(coordinate);
    double variance = pulledVariance(runner_, cost.influence(inverse.col(c)), residual, power);
    // What is stated lies off by its own deviation.
    for (Index k = 0; k < at.size(); ++k) {
      const double precision = cost.precision(static_cast<std::size_t>(k));
      variance += std::pow(inverse(k, c), 2) * prior_weight * precision;
    }
    std_dev[c] = std::sqrt(variance / inverse(c, c));
  });
  return std_dev.asDiagonal() * inverse * std_dev.asDiagonal();
}

}  // namespace smartmill::discrepancy
