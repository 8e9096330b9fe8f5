#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::report {

/// Limit on the difference of a figure from the truth.
struct Target {
  double percent = NOT_A_NUMBER;  ///< [percent] of the truth; NaN: none
  bool at_least = false;  ///< the difference must exceed it (raw force: shows that compensation is needed)
};

/// An estimate and its true value, in the unit of the report.
struct Figure {
  std::string name, unit;
  double estimate = NOT_A_NUMBER;
  double std_dev = NOT_A_NUMBER;  ///< NaN: unknown
  double truth = NOT_A_NUMBER;    ///< NaN: unknown (real machine)
  Target target;
  bool unchecked = false;  ///< the truth exists, but was not computed

  double percent() const;           ///< [percent] (estimate - truth) / |truth|; NaN if unknown
  double sigmas() const;            ///< [1] (estimate - truth) / std_dev; NaN if unknown
  std::optional<bool> met() const;  ///< empty: no target or no truth
};

/// Stiffness of a receptance's mode [N/m] and its standard deviation, to first order.
std::pair<double, double> stiffnessOf(const Mode& mode);

/// Pairs measured modes with true ones, nearest in the logarithm of the frequency first, each once, at most
/// an octave apart. @return index of the true mode for each measured one; empty: none
std::vector<std::optional<std::size_t>> matchModes(const std::vector<Mode>& measured,
                                                   const std::vector<Mode>& truth);

/// Samples of a force from blocks, by running index, so that two recordings of one sensor align sample by
/// sample.
class ForceTrack {
 public:
  /// A block with the first index of an earlier one replaces it.
  void add(const ForceBlock& block);
  bool empty() const { return blocks_.empty(); }
  double sampleRate() const { return sample_rate_; }

  /// Samples of one axis [N] with from <= index < to. @throws Error when one is missing.
  std::vector<double> axis(std::size_t axis, std::uint64_t from, std::uint64_t to) const;
  /// As axis(), NaN where a sample is missing.
  std::vector<double> axisWithGaps(std::size_t axis, std::uint64_t from, std::uint64_t to) const;
  /// Samples at rising times [s], nearest; NaN where none is within half a sample.
  std::vector<double> axisAt(std::size_t axis, const std::vector<double>& times) const;
  /// Index of the first sample not before a time [s]. @throws Error on an empty track.
  std::uint64_t indexAt(double stamp) const;
  /// Longest segment without a gap within from <= index < to. @param compensated only in blocks that are
  std::pair<std::uint64_t, std::uint64_t> covered(std::uint64_t from, std::uint64_t to,
                                                  bool compensated = false) const;

 private:
  std::map<std::uint64_t, ForceBlock> blocks_;  // by first index
  double sample_rate_ = 0.0;
};

/// Range from the 10th to the 90th percentile.
double middleRange(const std::vector<double>& values);

/// Share of the energy (without the mean) that is not synchronous with the spindle, as the chatter detector
/// computes it (RevolutionWindow). 0 for a forced vibration, towards 1 for chatter; NaN if the series is
/// shorter than a window.
/// @param samples_per_revolution may be fractional @param revolutions of a window, 2 or more
double nonperiodicShare(const std::vector<double>& values, double samples_per_revolution, int revolutions);

/// Local maximum of a stability limit.
struct Pocket {
  double spindle_speed = 0.0;  ///< [rad/s]
  double depth = 0.0;          ///< [m]
};

/// Local maxima of a limit that exceed the minima on both sides by a factor (> 1); the ends of the chart are
/// no pockets. Infinite depths count as `ceiling` [m]. The speed is the centroid of the pocket's top: of a
/// plateau the middle.
std::vector<Pocket> pockets(const std::vector<double>& speeds, const std::vector<double>& depths,
                            double factor, double ceiling);

/// Linear interpolation of y over rising x; NaN outside. @throws Error on unequal lengths.
double interpolate(const std::vector<double>& x, const std::vector<double>& y, double at);

}  // namespace smartmill::report
