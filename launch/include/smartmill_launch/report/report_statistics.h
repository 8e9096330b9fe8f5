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

/// What a figure has to reach.
struct Target {
  double percent = NOT_A_NUMBER;  ///< [percent] of the truth; NaN: none
  bool at_least = false;          ///< the difference must exceed it: shows what compensation is good for
};

/// One estimated number beside the truth, in the unit shown.
struct Figure {
  std::string name, unit;
  double estimate = NOT_A_NUMBER;
  double std_dev = NOT_A_NUMBER;  ///< NaN: not known
  double truth = NOT_A_NUMBER;    ///< NaN: not known, a real machine
  Target target;
  bool unchecked = false;  ///< the truth exists, but was not computed

  double percent() const;           ///< [percent] (estimate - truth) / |truth|; NaN where not known
  double sigmas() const;            ///< [1] (estimate - truth) / std_dev; NaN where not known
  std::optional<bool> met() const;  ///< empty: no target or no truth
};

/// Stiffness of a receptance's mode [N/m] and its standard deviation, to first order.
std::pair<double, double> stiffnessOf(const Mode& mode);

/// Pairs measured modes with true ones, nearest in the logarithm of the frequency first, each once, at most
/// an octave apart. @return index of the true mode for each measured one; empty: none
std::vector<std::optional<std::size_t>> matchModes(const std::vector<Mode>& measured,
                                                   const std::vector<Mode>& truth);

/// Samples of a force gathered from blocks by running index, so that two recordings of one sensor meet sample
/// by sample.
class ForceTrack {
 public:
  /// Blocks that overlap say the same; only whole blocks are taken.
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
  /// Longest stretch without a gap inside from <= index < to; status, where given, must be that of every
  /// block.
  std::pair<std::uint64_t, std::uint64_t> covered(std::uint64_t from, std::uint64_t to,
                                                  std::optional<ForceBlock::Status> status = {}) const;

 private:
  std::map<std::uint64_t, ForceBlock> blocks_;  // by first index
  double sample_rate_ = 0.0;
};

/// Range from the 10th to the 90th percentile.
double middleRange(const std::vector<double>& values);

/// Share of the energy (without the mean) that does not repeat every revolution: windows of whole
/// revolutions, in each the mean over its revolutions at every angle is what repeats. 0 for a forced
/// vibration, towards 1 for chatter. NaN when the series holds no window.
/// @param samples_a_revolution need not be whole @param revolutions of a window, 2 or more
double nonperiodicShare(const std::vector<double>& values, double samples_a_revolution, int revolutions);

/// One high place of a stability chart.
struct Pocket {
  double spindle_speed = 0.0;  ///< [rad/s]
  double depth = 0.0;          ///< [m]
};

/// Local maxima of a limit that stand out by a factor (> 1) over the valleys on both sides; the chart's ends
/// are no pockets. Infinite depths count as `ceiling` [m]; a plateau is taken at its middle.
std::vector<Pocket> pockets(const std::vector<double>& speeds, const std::vector<double>& depths,
                            double factor, double ceiling);

/// Linear interpolation of y over rising x; NaN outside. @throws Error on unequal lengths.
double interpolate(const std::vector<double>& x, const std::vector<double>& y, double at);

}  // namespace smartmill::report
