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
#include "smartmill_discrepancy/gap/scale_evidence.h"

namespace smartmill::discrepancy {
namespace {

using Values = std::vector<double>;
using Eigen::Index;
using Eigen::MatrixXd;

struct StoppingOptions {
  int max_without_gain = 4;  ///< steps in a row
  int patience = 3;          ///< steps before a competing fit ends this one
  /// [1] of the last gain: largest expected gain of all later steps.
  double expected_gain = 10.0;
  double min_excess = 20.0;  ///< squares above the noise of which the tolerance is a share at least
};

// Ends a fit when a step gains a negligible share of the squares above the noise, when several steps gain
// nothing, or when it cannot reach the competing fit.
class StoppingRule {
 public:
  StoppingRule(const FitOptions& options, double samples, const StoppingOptions& limits = {})
      : options_(options), limits_(limits), samples_(samples) {}

  bool mayContinue(const fit::Progress& now) {
    const double gain = before_ - now.squares;
    before_ = now.squares;
    steps_without_gain_ = gain > 0.0 ? 0 : steps_without_gain_ + 1;
    if (now.iteration == 0) return true;
    const bool negligible = gain > 0.0 && gain < minGain(now.squares);
    const bool cannot_improve =
        now.iteration >= limits_.patience && now.squares - options_.to_beat > limits_.expected_gain * gain;
    return !negligible && !cannot_improve && steps_without_gain_ < limits_.max_without_gain;
  }
  bool mayImprove(double squares, double predicted) const {
    return predicted >= minGain(squares) && squares - limits_.expected_gain * predicted <= options_.to_beat;
  }

 private:
  double minGain(double squares) const {
    return options_.tolerance * std::min(std::max(squares - samples_, limits_.min_excess), squares);
  }
  const FitOptions& options_;
  StoppingOptions limits_;
  double samples_, before_ = std::numeric_limits<double>::infinity();
  int steps_without_gain_ = 0;
};

struct SolverOptions {
  int cheap_step_factor = 2;  ///< more steps if each simulates few coordinates
  /// [1] Trust radii of successive runs if nominal values are simulated, and of the only run if they are
  /// frozen: damped for curved costs, then undamped.
  std::vector<double> radii_simulated{1e4, 1e10}, radii_frozen{1e5};
  double parameter_tolerance = 1e-7;  ///< [1] relative step: far below any standard deviation
};

// Damped steps for curved costs. If nominal values are simulated, undamped steps follow: an effect and a
// similar nominal value form a narrow valley in which damped steps are slow.
// @return no value if the twin gives no finite values at the start
std::optional<Eigen::VectorXd> solve(const CampaignCost& cost, const FitOptions& options, double samples,
                                     const std::function<bool()>& cancelled) {
  const SolverOptions steps;
  if (options.iterations == 0) return cost.coordinates().start();
  fit::Options solver;
  solver.name = "fit of a campaign";
  solver.iterations = cost.simulatesAll() ? options.iterations : steps.cheap_step_factor * options.iterations;
  solver.function_tolerance = 1e-15;  // StoppingRule decides
  solver.parameter_tolerance = steps.parameter_tolerance;
  solver.costly_derivatives = true;
  solver.finish_at_bounds = false;  // simulations are expensive and later rounds refit
  std::vector<fit::Parameter> parameters = cost.parameters();
  Eigen::VectorXd own(static_cast<Index>(parameters.size()));
  const std::vector<double>& radii = cost.simulatesAll() ? steps.radii_simulated : steps.radii_frozen;
  for (const double radius : radii) {
    StoppingRule rule(options, samples);
    solver.progress = [&](const fit::Progress& now) {
      return rule.mayContinue(now) && !(cancelled && cancelled());
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
    if (radius == radii.back() || !rule.mayImprove(result.squares, cost.predictedReductionAt(own))) break;
  }
  return cost.pointAt(own);
}

// Inverse of the information with priors.
MatrixXd covarianceOf(const CampaignCost& cost, MatrixXd information) {
  for (Index c = 0; c < information.cols(); ++c) information(c, c) += cost.coordinates().precision()[c];
  return linear::inverseSymmetric(information);
}

// [1] Upper 5 % limit of a variance estimate over the variance, by degrees of freedom (Wilson and Hilferty
// 1931).
double chanceScatterLimit(double freedom) {
  const double spread = 2.0 / (9.0 * freedom);
  return std::pow(1.0 - spread + 1.645 * std::sqrt(spread), 3);
}

// Variance of influence.residual over all tests.
double influenceVariance(const TwinRunner& runner, const Eigen::VectorXd& influence,
                         const Eigen::VectorXd& residual, const std::vector<Values>& power) {
  std::map<std::size_t, ScaleEvidence> by_test;
  for (std::size_t b = 0; b < power.size(); ++b) {
    const ChannelSpan& block = runner.spans()[b];
    by_test[block.test].add(influence.data() + block.offset, residual.data() + block.offset, block.size,
                            power[b]);
  }
  std::vector<ScaleEvidence> tests;
  double squares = 0.0;
  for (const auto& [test, evidence] : by_test) {
    tests.push_back(evidence);
    squares += evidence.squares;
  }
  const double uncorrelated = std::max(squares, varianceOfLines(tests));
  const TestScatter scatter = testScatterOf(tests);
  const double freedom = std::max(scatter.freedom, 1.0);
  if (scatter.variance < chanceScatterLimit(freedom) * uncorrelated)
    return std::max(uncorrelated, scatter.variance);
  // Each test has an error of its own, whose size a few tests estimate poorly.
  const double student = studentOverNormal(freedom);
  return student * student * scatter.variance;
}

// Cost, residual and covariance at a point. @return false if there are no finite values
bool describe(const CampaignCost& cost, const Eigen::VectorXd& at, double samples, std::size_t records,
              FitResult& fit) {
  const CampaignLinearisation::Linear* point = cost.linearisation().linearise(at);
  if (!point) return false;
  fit.state = cost.coordinates().stateAt(at);
  const Eigen::VectorXd residual = cost.linearisation().residual(at);
  fit.chi2 = residual.squaredNorm();
  fit.residual.resize(static_cast<std::size_t>(residual.size()));
  Eigen::Map<Eigen::VectorXd>(fit.residual.data(), residual.size()) = -residual;
  fit.penalty = cost.coordinates().penaltyAt(at);
  fit.bic = fit.chi2 + fit.penalty;
  const auto of_records = static_cast<double>(records);
  for (const Member& m : fit.state.members) {
    fit.bic += static_cast<double>(m.values.size()) * std::log(samples) + m.hypothesis->bic_penalty;
    fit.bic += m.hypothesis->found_in_each_record * of_records * std::log(samples / of_records);
  }
  fit.covariance = covarianceOf(cost, point->information);
  return true;
}

}  // namespace

bool hasMember(const FitState& state, const std::string& effect, const std::string& variant) {
  return std::any_of(state.members.begin(), state.members.end(), [&](const Member& m) {
    return m.hypothesis->effect == effect && m.hypothesis->variant == variant;
  });
}

FitState without(const FitState& state, std::size_t member) {
  FitState less = state;
  less.members.erase(less.members.begin() + static_cast<std::ptrdiff_t>(member));
  return less;
}

Fitter::Fitter(const TwinRunner& runner, const NominalFreedom& freedom, std::function<bool()> cancelled)
    : runner_(runner), freedom_(freedom), cancelled_(std::move(cancelled)) {
  for (std::size_t k = 0; k < runner.tests().size(); ++k) {
    for (const AlignmentFreedom& free : alignmentFreedoms(runner.data().tests[runner.tests()[k]]))
      alignments_.push_back({k, free});
  }
}

NominalTangents NominalTangents::ofAlignments() const {
  const auto count = static_cast<Index>(alignment.size());
  return {{}, alignment, columns.lastColumns(count), information.bottomRightCorner(count, count)};
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
  std::vector<SimulatedChannels> simulated = runner_.simulateChannels(models);
  const SimulatedChannels base = std::move(simulated.front());
  simulated.erase(simulated.begin());
  simulated.resize(coordinates.size() + alignments_.size());
  for (const FreeAlignment& t : alignments_) steps.push_back(t.freedom.step);
  runParallel(alignments_.size(), runner_.threads(), [&](std::size_t k) {
    RecordAlignment by;
    by.*alignments_[k].freedom.value = alignments_[k].freedom.step;
    simulated[coordinates.size() + k] = runner_.realigned(models.front(), base, alignments_[k].chosen, by);
  });
  NominalTangents tangents{
      state.nominal, state.alignment, SparseColumns(runner_, base, simulated, steps), {}};
  tangents.alignment.resize(alignments_.size(), 0.0);
  tangents.information = tangents.columns.gram();
  return tangents;
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

FitResult Fitter::fit(const FitState& start, const NominalTangents* frozen, const FitOptions& options) const {
  const CampaignCost cost(*this, start, frozen, options);
  const double samples = runner_.channels().effectiveSamples();
  FitResult fit;
  const std::optional<Eigen::VectorXd> at = solve(cost, options, samples, cancelled_);
  fit.converged = at && describe(cost, *at, samples, runner_.tests().size(), fit);
  if (!fit.converged) {
    fit.state = start;
    fit.chi2 = fit.bic = std::numeric_limits<double>::infinity();
  }
  return fit;
}

std::optional<FitState> Fitter::linearOptimum(const FitState& state, const NominalTangents& tangents,
                                              double prior_weight) const {
  FitOptions options;
  options.prior_weight = prior_weight;
  const CampaignCost cost(*this, state, &tangents, options);
  const std::optional<Eigen::VectorXd> at = cost.linearOptimumFrom(cost.coordinates().start());
  return at ? std::optional<FitState>(cost.coordinates().stateAt(*at)) : std::nullopt;
}

double Fitter::penalty(const FitState& state, double prior_weight) const {
  FitOptions options;
  options.prior_weight = prior_weight;
  const CampaignCoordinates coordinates(*this, state, nullptr, options);
  return coordinates.penaltyAt(coordinates.start());
}

MatrixXd Fitter::sandwichCovariance(const FitState& state, const NominalTangents& tangents,
                                    double prior_weight) const {
  FitOptions options;
  options.prior_weight = prior_weight;
  const CampaignCost cost(*this, state, &tangents, options);
  const Eigen::VectorXd& at = cost.coordinates().start();
  Eigen::VectorXd std_dev(at.size());
  CampaignLinearisation& linearisation = cost.linearisation();
  const CampaignLinearisation::Linear* point = linearisation.linearise(at);
  if (!point) return {};
  const MatrixXd inverse = covarianceOf(cost, point->information);
  const Eigen::VectorXd residual = linearisation.residual(at);
  const std::vector<ChannelSpan>& blocks = runner_.spans();
  std::vector<Values> power(blocks.size());
  runParallel(blocks.size(), runner_.threads(), [&](std::size_t b) {
    power[b] = powerSpectrum(residual.data() + blocks[b].offset, blocks[b].size);
  });
  runParallel(cost.coordinates().size(), runner_.threads(), [&](std::size_t coordinate) {
    const auto c = static_cast<Index>(coordinate);
    double variance = influenceVariance(runner_, linearisation.influence(inverse.col(c)), residual, power);
    // Stated values have an error of their own.
    for (Index k = 0; k < at.size(); ++k) {
      const double precision = cost.coordinates().precision()[k];
      variance += std::pow(inverse(k, c), 2) * prior_weight * precision;
    }
    std_dev[c] = std::sqrt(variance / inverse(c, c));
  });
  return std_dev.asDiagonal() * inverse * std_dev.asDiagonal();
}

}  // namespace smartmill::discrepancy
