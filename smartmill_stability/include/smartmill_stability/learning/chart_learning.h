#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "smartmill_stability/chart/uncertainty.h"
#include "smartmill_stability/learning/judged_cut.h"
#include "smartmill_stability/learning/machine_prior.h"

namespace smartmill::stability {

/// Cuts among which the next one and the recommended one are chosen.
struct CutRange {
  double speed_low = 0.0, speed_high = 0.0;  ///< [rad/s] 0 < low < high
  double max_depth = 0.0;                    ///< [m] > 0
  /// [m] Largest depth at a speed [rad/s], for example by the power of the spindle; empty: max_depth.
  std::function<double(double speed)> depth_limit = nullptr;

  void validate() const;  ///< @throws Error naming quantity and value
};

struct LearningOptions {
  std::size_t candidates = 10000;  ///< machines drawn before the first cut (Schmitz: 10,000)
  std::size_t kept = 500;          ///< machines after the first resampling
  double least_effective = 0.5;    ///< [1] share of effective machines, below which they are resampled
  int moves = 4;                   ///< Markov steps of each machine after a resampling
  double wrong = 0.02;             ///< [1] probability that a cut is not as its machine predicts
  /// [1] Standard deviation of a predicted chatter frequency, combined with that of the measured one.
  double frequency_error = 0.03;
  /// [1] Probability that a chatter frequency is not the predicted one: another lobe or an alias.
  double other_component = 0.05;
  /// [1] Standard deviation of log(limit): the machines do not contain the true one (more modes, loss of
  /// contact), and the zero-order limit from which candidates are chosen is not the exact one.
  double scatter = 0.2;
  double risk = 0.05;  ///< [1] largest probability of chatter of the recommended cut
  /// [1] Added to the probability of chatter: a small value makes proposals cautious, a large one bold.
  double risk_offset = 0.15;
  std::size_t shown = 250;  ///< machines of a chart
  std::size_t judged = 80;  ///< machines that judge a recommended cut by collocation
  std::uint64_t seed = 1;

  void validate() const;  ///< @throws Error naming quantity and value
};

/// A cut with the probability that it is stable.
struct CutProposal {
  double speed = 0.0;    ///< [rad/s]
  double depth = 0.0;    ///< [m]
  double stable = 0.0;   ///< [1] probability
  double std_dev = 0.0;  ///< [1] of the probability, from the number of machines that judge
  /// Speed x depth, in proportion to the material removal rate at constant feed per tooth. [m rad/s]
  double removal() const { return speed * depth; }
};

/// Mean and standard deviation of the logarithm of a quantity over the weighted machines.
struct LogEstimate {
  double median = 0.0;   ///< exp of the mean logarithm
  double log_std = 0.0;  ///< [1]
};
struct MachineEstimate {
  std::array<LogEstimate, 2> frequency;  ///< [Hz] of the most flexible mode along x and y
  std::array<LogEstimate, 2> stiffness;  ///< [N/m] of it
  std::array<LogEstimate, 2> damping;    ///< [1] of it
  LogEstimate kt;                        ///< [N/m2]
  LogEstimate limit;                     ///< [m] least limit over the speeds
};

/// Stability chart from cuts alone: machines drawn from a prior are candidates, each with its chart; every
/// cut weights them by the likelihood of what was observed (Karandikar, Traverso, Abbas and Schmitz, J.
/// Manuf. Sci. Eng. 136, 2014; Cornelius, Karandikar and Schmitz, npj Advanced Manufacturing 1, 2024):
///
///     L = (wrong + (1 - wrong) Phi(+-log(b / b_lim) / scatter)) exp(-(f / f_cut - 1)^2 / (2 s_f^2))
///         exp(-(kt - kt_cut)^2 / (2 s_kt^2))
///
/// with the depth b of the cut (+ chatter, - stable), limit b_lim and chatter frequency f by the zero-order
/// solution. A recommended cut is judged by collocation, with helix and interrupted cutting. When few
/// machines agree, they are resampled and moved by Markov steps that leave the posterior unchanged
/// (resample-move, Gilks and Berzuini, J. Royal Statistical Society B 63, 2001): preconditioned
/// Crank-Nicolson steps in some coordinates, and differences of two other machines (ter Braak, Statistics and
/// Computing 16, 2006).
class ChartLearning {
 public:
  /// @throws Error on values out of range.
  ChartLearning(const MachinePrior& prior, const CutRange& range, const LearningOptions& options = {});

  /// @throws Error on values out of range,
  void add(const JudgedCut& cut);

  /// The cut with the largest expected gain in removal over the recommended one per risk:
  /// P(stable) x gain / (risk_offset + P(chatter)). Depth 0: no cut of the range is left.
  CutProposal next() const;
  /// The cut that removes most among those with at most the accepted risk; empty if there is none within the
  /// range. A cut that was stable, and every less deep one at its speed, has at least 1 - wrong.
  std::optional<CutProposal> recommended() const;

  /// Probability that a cut is stable, by collocation. @param speed [rad/s], depth [m]
  CutProposal judge(double speed, double depth) const;
  /// The same over speeds [rad/s] and depths [m] by the zero-order solution with the scatter; nominal: limit
  /// with a probability of one half.
  ProbabilityChart chart(const std::vector<double>& speeds, const std::vector<double>& depths) const;

  MachineEstimate estimate() const;
  /// [1] Effective number of machines before resampling by the last cut.
  double effective() const { return effective_; }
  const std::vector<JudgedCut>& cuts() const { return cuts_; }

 private:
  struct Machine {
    std::vector<double> at;       // standard normal coordinates
    double log_likelihood = 0.0;  // of all cuts
    double log_weight = 0.0;      // since the last resampling
  };
  double logLikelihood(const std::vector<double>& at) const;
  std::optional<CutProposal> chosen(bool exact) const;
  std::optional<CutProposal> judge(double speed, double depth, double risk) const;
  std::vector<double> weights() const;
  std::vector<std::size_t> drawIndices(std::size_t count, std::mt19937_64& random) const;
  void resample();
  void move();
  void show();
  double knownStable(double speed, double depth) const;

  MachinePrior prior_;
  CutRange range_;
  LearningOptions options_;
  std::mt19937_64 random_;
  std::vector<Machine> machines_;
  std::vector<JudgedCut> cuts_;
  std::vector<double> cut_speeds_;  // [rad/s] ascending, each once
  double effective_ = 0.0;
  // Equally weighted machines that are shown: exact ones, and their zero-order limits over the grid.
  std::vector<RegenerativeSystem> shown_;
  std::vector<double> speeds_;                    // [rad/s]
  std::vector<double> depths_;                    // [m]
  std::vector<double> most_;                      // [m] largest depth at each speed
  std::vector<std::vector<double>> probability_;  // [speed][depth] of a stable cut
};

}  // namespace smartmill::stability
