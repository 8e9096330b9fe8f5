#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "smartmill_discrepancy/gap/block_columns.h"
#include "smartmill_discrepancy/gap/twin_runner.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"
#include "smartmill_discrepancy/hypotheses/nominal_freedom.h"

namespace smartmill::discrepancy {

/// An effect taken into the model.
struct Member {
  const Hypothesis* hypothesis = nullptr;
  std::vector<double> values;  ///< of its coordinates

  bool operator==(const Member& o) const { return hypothesis == o.hypothesis && values == o.values; }
};

/// A point in the space of all models: nominal values and effects.
struct FitState {
  std::vector<double> nominal;  ///< coordinates of NominalFreedom
  std::vector<Member> members;
  /// What is free of where the records lie (turnFreedoms() of each, in the runner's order), beside where they
  /// lay when they were loaded. Empty: there.
  std::vector<double> turns;

  bool operator==(const FitState& o) const {
    return nominal == o.nominal && members == o.members && turns == o.turns;
  }
};

/// The same without one of its members.
FitState without(const FitState& state, std::size_t member);

struct Fit {
  FitState state;
  double chi2 = 0.0;     ///< sum of squares of residuals over noise
  double penalty = 0.0;  ///< of the priors
  /// chi2 + penalty + effect coordinates x ln(samples) + handicaps + for what is found in each record
  /// ln(samples of a record) a record: without it, noise alone would make a tone
  double bic = 0.0;
  std::vector<double> residual;  ///< (measured - simulated) / noise at the state; empty unless converged
  /// Covariance of nominal coordinates, then members' in their order, then turns: inverse of Fisher
  /// information with priors.
  Eigen::MatrixXd covariance;
  bool converged = false;  ///< false: the twin gives no numbers there; chi2 and bic are infinite
};

/// Tangents of the nominal coordinates about a state, and of where the records lie: what phase, speed and
/// entry can stand for is told from what they cannot in every fit.
struct NominalTangents {
  std::vector<double> at;       ///< nominal coordinates
  std::vector<double> turns;    ///< as in FitState
  BlockColumns columns;         ///< one a nominal coordinate, then one a turn
  Eigen::MatrixXd information;  ///< columns' * columns

  /// Those of the turns alone: a fit with them simulates the nominal values.
  NominalTangents ofTurns() const;
};

struct FitOptions {
  int iterations = 8;
  double tolerance = 1e-4;  ///< relative change of the cost that ends a fit
  bool nominal_free = true;
  double prior_weight = 1.0;  ///< [1] of the priors' squares: the residual's variance where structure is left
  /// [1] Squares that another fit leaves: one that cannot come near to them ends early.
  double to_beat = std::numeric_limits<double>::infinity();
};

/// Fits models to a campaign by Ceres: nominal values under their Gaussian priors, effects within bounds and
/// weak priors; tangents by one simulation a coordinate.
class Fitter {
 public:
  /// @param runner, freedom must outlive this. @param cancelled asked at each step of a fit: true ends it
  /// there
  Fitter(const TwinRunner& runner, const NominalFreedom& freedom, std::function<bool()> cancelled = {});

  MachineModel model(const FitState& state) const;

  /// About a state at whose turns the runner stands.
  NominalTangents nominalTangents(const FitState& state) const;
  /// A turn's freedom in one of the runner's tests.
  struct TurnOf {
    std::size_t chosen;
    TurnFreedom freedom;
  };
  const std::vector<TurnOf>& turns() const { return turns_; }

  /// @param frozen nominal values and turns act linearly along these tangents; without nominal ones, or
  /// nullptr: they are simulated anew
  /// @return at a start where the twin gives no numbers: the start, not converged
  Fit fit(const FitState& start, const NominalTangents* frozen, const FitOptions& options) const;

  /// Where squares and priors would be least were the twin straight about a state, nominal values and turns
  /// included. @param tangents taken there @return no value where the twin gives no numbers
  std::optional<FitState> straightOn(const FitState& state, const NominalTangents& tangents,
                                     double prior_weight) const;
  /// As Fit::penalty.
  double penalty(const FitState& state, double prior_weight) const;

  /// Covariance of a fit at its state when what is left is not noise: each value is moved by u.r, u its
  /// influence over the samples, and that has the variance of varianceOfProducts(), if not less than that of
  /// noise, with Student's t where the tests scatter by more than chance. Correlations are those of the fit
  /// (inverse information with priors).
  /// @param tangents taken at the state @param prior_weight with which it was fitted
  /// @return as Fit::covariance; empty where the twin gives no numbers
  Eigen::MatrixXd sandwichCovariance(const FitState& state, const NominalTangents& tangents,
                                     double prior_weight) const;

  bool cancelled() const { return cancelled_ && cancelled_(); }
  const TwinRunner& runner() const { return runner_; }
  const NominalFreedom& freedom() const { return freedom_; }

 private:
  const TwinRunner& runner_;
  const NominalFreedom& freedom_;
  std::function<bool()> cancelled_;
  std::vector<TurnOf> turns_;
};

}  // namespace smartmill::discrepancy
