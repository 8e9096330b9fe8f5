#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace smartmill::stability {

/// A cut that was heard.
struct HeardCut {
  double speed = 0.0;               ///< [rad/s]
  std::optional<double> frequency;  ///< [Hz] of the chatter; empty: stable
};

/// A spindle speed to try.
struct SpeedProposal {
  double speed = 0.0;   ///< [rad/s]
  double stable = 0.0;  ///< [1] probability that the same cut is stable there, if it is at any speed
};

/// What is known before the first cut.
struct SpeedSearchOptions {
  std::size_t machines = 2000;  ///< drawn at a time
  double effective = 300.0;     ///< [1] least effective number of machines, for which more are drawn
  std::uint64_t batches = 20;   ///< most draws
  double low_damping = 0.005, high_damping = 0.08;  ///< [1] damping ratio, log-uniform
  double largest_ratio = 4.0;  ///< [1] depth over the limit at the first speed, log-uniform from 1 to this,
                               ///< or to the largest limit over it
  double frequency_error = 0.03;  ///< [1] of a predicted chatter frequency
  double wrong = 0.02;            ///< [1] probability that a cut is not as its machine predicts
  std::uint64_t seed = 1;
};

/// Spindle speeds at which a cut that chatters becomes stable at the same depth, from the chatter frequencies
/// and the stable cuts that were heard; of the machine the number of teeth only is known.
///
/// Machines with one to four modes in two directions, an engagement and a depth are drawn such that the first
/// cut chatters at the frequency that was heard and some speed is stable (otherwise the depth must be
/// reduced). Their limits are the zero-order ones (ZeroOrderLobes, Dunwoody eq. 6.10..6.14). Each cut that
/// was heard weights the machines by its likelihood; while few agree, more are drawn, with modes near the
/// frequencies heard. The probability of a stable cut is the weighted share of machines; with a tenth of the
/// weight the rule that the tooth passing frequency is a divisor of the chatter frequency takes part.
class SpeedSearch {
 public:
  /// @param teeth evenly spaced @param low, high [rad/s] range of the spindle
  /// @throws Error on values out of range.
  SpeedSearch(int teeth, double low, double high, const SpeedSearchOptions& options = {});

  /// @throws Error if the first cut does not chatter, and on values out of range.
  void heard(const HeardCut& cut);
  /// Proposals at all speeds of the grid, slowest first. Empty before the first cut.
  std::vector<SpeedProposal> proposals() const;
  /// The speed to try: the largest probability of a stable cut; of nearly equal ones the fastest.
  SpeedProposal next() const;

 private:
  struct Machine {
    double depth = 1.0;             // on the scale of the limits
    std::vector<double> limit;      // [speed]
    std::vector<double> frequency;  // [speed] of the chatter at that limit, Hz
    double weight = 1.0;
  };
  void draw();
  double likelihoodOf(const Machine& machine, const HeardCut& cut) const;
  double effectiveMachines() const;
  bool followsRule(double speed) const;
  std::size_t nearest(double speed) const;

  int teeth_;
  SpeedSearchOptions options_;
  std::vector<double> speeds_;  // [rad/s] grid over the range of the spindle
  std::uint64_t batches_ = 0;
  std::vector<Machine> machines_;
  std::vector<HeardCut> cuts_;
};

/// The five likeliest of SpeedSearch::proposals(), each the best of its surroundings; likeliest first.
std::vector<SpeedProposal> bestProposals(const std::vector<SpeedProposal>& all);

}  // namespace smartmill::stability
