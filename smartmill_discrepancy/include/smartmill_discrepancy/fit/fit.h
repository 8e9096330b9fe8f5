#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "smartmill_discrepancy/gap/sparse_columns.h"
#include "smartmill_discrepancy/gap/twin_runner.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"
#include "smartmill_discrepancy/hypotheses/nominal_freedom.h"

namespace smartmill::discrepancy {

/// An effect of the model.
struct Member {
  const Hypothesis* hypothesis = nullptr;
  std::vector<double> values;  ///< of its coordinates

  bool operator==(const Member& o) const { return hypothesis == o.hypothesis && values == o.values; }
};

/// A point in the space of all models: nominal values and effects.
struct FitState {
  std::vector<double> nominal;  ///< coordinates of NominalFreedom
  std::vector<Member> members;
  /// Free alignment values (alignmentFreedoms() of each record, in the runner's order) relative to the loaded
  /// records. Empty: all zero.
  std::vector<double> alignment;

  bool operator==(const FitState& o) const {
    return nominal == o.nominal && members == o.members && alignment == o.alignment;
  }
};

/// Whether a state has an effect in this variant.
bool hasMember(const FitState& state, const std::string& effect, const std::string& variant);
/// The state without one of its members.
FitState without(const FitState& state, std::size_t member);

struct FitResult {
  FitState state;
  double chi2 = 0.0;     ///< sum of squares of the whitened residual
  double penalty = 0.0;  ///< of the priors
  /// chi2 + penalty + (effect coordinates) x ln(samples) + BIC penalties + ln(samples of a record) for each
  /// value estimated per record; without the latter noise alone would give a tone
  double bic = 0.0;
  std::vector<double> residual;  ///< (measured - simulated) / noise at the state; empty unless converged
  /// Covariance of nominal coordinates, members' values in their order, alignment: inverse Fisher information
  /// with priors.
  Eigen::MatrixXd covariance;
  bool converged = false;  ///< false: the twin gives no finite values; chi2 and bic are infinite
};

/// Derivatives with respect to nominal coordinates and alignment at a state.
struct NominalTangents {
  std::vector<double> at;         ///< nominal coordinates
  std::vector<double> alignment;  ///< as in FitState
  SparseColumns columns;          ///< one per nominal coordinate, then one per alignment value
  Eigen::MatrixXd information;    ///< columns' * columns

  /// Those of the alignment alone: a fit with them simulates the nominal values.
  NominalTangents ofAlignments() const;
};

struct FitOptions {
  int iterations = 8;       ///< of the solver; 0: the start
  double tolerance = 1e-4;  ///< [1] of the squares above the noise: a smaller gain of a step ends the fit
  double prior_weight =
      1.0;  ///< [1] factor on the priors' squares: the residual's variance if it exceeds the noise
  /// [1] Squares of a competing fit: a fit that cannot reach them ends early.
  double to_beat = std::numeric_limits<double>::infinity();

  /// Close to the minimum, as far as derivatives at one point are valid.
  static FitOptions closely() { return {}; }
  /// To the last digits that the twin distinguishes, for a state that others are compared with.
  static FitOptions tightly() { return {8, 1e-5}; }
  /// To rank candidates, whose gains differ by far more.
  static FitOptions toCompare() { return {6, 1e-3}; }
  /// Cost, residual and covariance at the start.
  static FitOptions toEvaluate() { return {0}; }
};

/// Fits models to a campaign with Ceres: nominal values with Gaussian priors, effects within bounds and weak
/// priors; derivatives by one simulation per coordinate.
class Fitter {
 public:
  /// @param runner, freedom must outlive this object
  /// @param cancelled called at each step of a fit: true ends the fit
  Fitter(const TwinRunner& runner, const NominalFreedom& freedom, std::function<bool()> cancelled = {});

  MachineModel model(const FitState& state) const;

  /// At a state whose alignment the runner has.
  NominalTangents nominalTangents(const FitState& state) const;
  /// Free alignment value of one of the runner's tests.
  struct FreeAlignment {
    std::size_t chosen;
    AlignmentFreedom freedom;
  };
  const std::vector<FreeAlignment>& alignment() const { return alignments_; }

  /// @param frozen nominal values and alignment act linearly along these derivatives; nominal values are
  /// simulated if it has none or is nullptr
  /// @return the start, not converged, if the twin gives no finite values there
  FitResult fit(const FitState& start, const NominalTangents* frozen, const FitOptions& options) const;

  /// Minimum of squares and priors if the twin were linear about a state, nominal values and alignment
  /// included.
  /// @param tangents at that state @return no value if the twin gives no finite values
  std::optional<FitState> linearOptimum(const FitState& state, const NominalTangents& tangents,
                                        double prior_weight) const;
  /// As FitResult::penalty.
  double penalty(const FitState& state, double prior_weight) const;

  /// Covariance of a fit whose residual is not white noise. Each value is displaced by u.r, u its influence
  /// over the samples; the variance of u.r is varianceOfProducts(), at least that of noise, with Student's t
  /// if the tests scatter significantly. Correlations are those of the inverse information with priors.
  /// @param tangents at the state @param prior_weight of the fit
  /// @return as FitResult::covariance; empty if the twin gives no finite values
  Eigen::MatrixXd sandwichCovariance(const FitState& state, const NominalTangents& tangents,
                                     double prior_weight) const;

  bool cancelled() const { return cancelled_ && cancelled_(); }
  const TwinRunner& runner() const { return runner_; }
  const NominalFreedom& freedom() const { return freedom_; }

 private:
  const TwinRunner& runner_;
  const NominalFreedom& freedom_;
  std::function<bool()> cancelled_;
  std::vector<FreeAlignment> alignments_;
};

/// Derivatives with respect to the values of these members, one member after the other.
/// @param base receives the simulation of the state
SparseColumns memberTangents(const Fitter& fitter, const FitState& state,
                             const std::vector<std::size_t>& members, SimulatedChannels* base);

}  // namespace smartmill::discrepancy
