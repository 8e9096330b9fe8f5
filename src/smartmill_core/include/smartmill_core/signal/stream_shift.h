#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace smartmill {

/// An evenly sampled signal.
struct SampledSignal {
  double begin = 0.0;  ///< [s] time of the first sample
  double rate = 0.0;   ///< [Hz]
  std::vector<double> values;
};

/// By how much one stream is stamped later than another one that shows the same event.
struct StreamShift {
  double delay = 0.0, std_dev = 0.0;  ///< [s]
  double explained = 0.0;  ///< [1] share of the squares of the late signal by the early one; of taps 1
  std::size_t events = 0;  ///< [1] records or taps that show it
};

struct StreamShiftOptions {
  double range = 1.0;  ///< [s] searched to either side (formats.md, stream_offset_s)
  /// [1] Share of the squares of the late signal that the early one explains at the shift: noise alone
  /// explains thousandths, an axis that moves a sensor nearly all where the records move.
  double min_explained = 0.2;
  double max_other = 0.5;  ///< [1] of that, of any other shift: a periodic motion fits at several
  double lobe = 0.5;       ///< [1] of the largest share, within which shifts belong to the same peak
};

/// Two signals of the same times.
struct SignalPair {
  std::vector<double> late, early;  ///< equally long
};

/// The shift at which the early signals, by one factor for all records, explain most of the squares of the
/// late ones, each about its mean: the largest normalised cross-correlation.
/// @param rate [Hz] of all @return no value: nothing explains, or several shifts do
std::optional<StreamShift> shiftByCorrelation(const std::vector<SignalPair>& records, double rate,
                                              const StreamShiftOptions& options = {});

/// Both signals at the times that they share, averaged over the new sample period. @param rate [Hz] at most
/// that of either for averages, else interpolated linearly @return empty where they share no time
SignalPair onCommonTimes(const SampledSignal& late, const SampledSignal& early, double rate);

/// The shift of the onsets of taps that both sensors see: the time at which a signal first exceeds a tenth of
/// the peak of its tap. The sensors may be of different kinds; onsets of pulses that rise at different rates
/// are uncertain by the difference of their rise times.
/// @return no value: no tap in one of them, or several shifts fit
std::optional<StreamShift> shiftByTaps(const SampledSignal& late, const SampledSignal& early,
                                       const StreamShiftOptions& options = {});

}  // namespace smartmill
