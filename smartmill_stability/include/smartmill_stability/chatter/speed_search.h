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
  double stable = 0.0;  ///< [1] probability that the same cut is stable there
};

/// What is known before the first cut.
struct SpeedSearchOptions {
  std::size_t machines = 2000;  ///< drawn at a time
  double effective = 300.0;     ///< [1] least effective number of machines, for which more are drawn
  std::uint64_t batches = 20;   ///< most draws
  double low_damping = 0.005, high_damping = 0.08;  ///< [1] damping ratio, log-uniform
  double largest_ratio = 6.0;     ///< [1] depth over the limit at the first speed, log-uniform from 1
  double frequency_error = 0.03;  ///< [1] of a predicted chatter frequency
  double wrong = 0.02;            ///< [1] probability that a cut is not as its machine predicts
  std::uint64_t seed = 1;
};

/// Spindle speeds at which a cut that chatters becomes stable at the same depth, from the chatter frequencies
/// and the stable cuts that were heard; of the machine the number of teeth only is known.
///
/// Machines of one to four modes (the same bending in the other direction, and others) and an unknown depth
/// over the limit are drawn such that the first cut chatters at the frequency that was heard. Their limits
/// are zero-order ones of one direction: -1 / (2 Re G) at the frequencies whose phase between the waves of
/// consecutive teeth, pi + 2 arg G, fits the tooth passing period (Tlusty; Dunwoody eq. 6.10..6.14 with one
/// eigenvalue). Each cut that was heard weights the machines by its likelihood, more are drawn while few
/// agree, and the probability of a stable cut is the weighted share of machines; with a tenth of the weight
/// the rule that the tooth passing frequency is a divisor of the chatter frequency takes part.
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
  struct Mode {
    double frequency, damping, flexibility;  // [1] relative, [1], [1] relative; negative: it acts backwards
  };
  struct Point {
    double frequency, limit, phase;  // [1] relative, [1], [rad] between consecutive waves, unwrapped
  };
  struct Machine {
    double depth = 1.0;             // [1] on the scale of the limits
    std::vector<double> limit;      // [speed]
    std::vector<double> frequency;  // [speed] of the chatter at that limit, Hz
    double weight = 1.0;
  };
  void draw();
  static std::vector<Point> pointsOf(const std::vector<Mode>& modes);
  std::pair<double, double> limitAt(const std::vector<Point>& points, double scale, double speed) const;
  double likelihoodOf(const Machine& machine, const HeardCut& cut) const;
  double effectiveMachines() const;
  bool followsRule(double speed) const;
  double speedAt(std::size_t k) const;
  std::size_t nearest(double speed) const;

  int teeth_;
  double low_, high_;
  SpeedSearchOptions options_;
  std::size_t speeds_ = 0;
  std::uint64_t batches_ = 0;
  std::vector<Machine> machines_;
  std::vector<HeardCut> cuts_;
};

/// The five likeliest of SpeedSearch::proposals(), each the best of its surroundings; likeliest first.
std::vector<SpeedProposal> bestProposals(const std::vector<SpeedProposal>& all);

}  // namespace smartmill::stability
