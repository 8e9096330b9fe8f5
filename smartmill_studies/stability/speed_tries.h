#pragma once

#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "smartmill_stability/chatter/speed_search.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// A drawn machine with a cut that chatters, and stable speeds at the same depth.
struct ChatteringCut {
  RegenerativeSystem system;
  double low = 0.0, high = 0.0;  ///< [rad/s] range of the spindle
  double depth = 0.0;            ///< [m]
  double speed = 0.0;            ///< [rad/s] of the first cut
  double stable_share = 0.0;     ///< [1] of the speeds of the range
};

/// Machines with two modes in x and two in y, 2 .. 5 teeth, slots and half or quarter immersion, up and down;
/// the depth is such that 5 .. 40 % of the speeds are stable. @param random seeded
ChatteringCut drawChatteringCut(std::mt19937_64& random);

/// Cuts at speeds that a rule chooses until one is stable.
struct Tries {
  std::vector<double> speeds;  ///< [rad/s] after the first cut
  std::vector<double> stated;  ///< [1] probability of a stable cut that the rule stated; NaN: none
  bool stable = false;         ///< the last one is
};

/// What the microphone hears of a cut: stability by collocation, the chatter frequency with an error.
class Hearing {
 public:
  Hearing(const ChatteringCut& cut, std::uint64_t seed);
  HeardCut at(double speed);

 private:
  const ChatteringCut& cut_;
  std::unique_ptr<FloquetSolver> solver_;
  std::mt19937_64 random_;
};

/// By SpeedSearch. @param most tries
Tries bySearch(const ChatteringCut& cut, std::uint64_t seed, int most);
/// By the rule that the tooth passing frequency is a divisor of the last chatter frequency, 60 f / (N k): the
/// fastest speed of the range that was not tried, or the nearest to the last one.
Tries byRule(const ChatteringCut& cut, std::uint64_t seed, int most, bool nearest);

}  // namespace smartmill::stability
