#pragma once

#include <array>
#include <optional>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::panel {

struct SpectrumParameters {
  int samples = 8192;
  int lines = 512;
  double highest = 5000.0;

  void declare(ParameterTable& table) {
    table.number("spectrum_samples", samples, "1", Range::closed(64, 1 << 20),
                 "of the newest stretch that is transformed; of 25.6 kHz 8192 resolve 3.1 Hz");
    table.number("spectrum_lines", lines, "1", Range::closed(8, 16384),
                 "of the message, each the largest of its neighbours");
    table.number("spectrum_highest", highest, "Hz", Range::positive(), "frequency shown");
  }
};

/// Amplitudes of the newest stretch, Hann window, mean taken off; a sine shows its amplitude (on a line
/// exactly, between two lines up to 15 % less). Lines are joined to the largest of their neighbours, so that
/// no peak is lost.
struct ForceSpectrum {
  double stamp = 0.0;                           ///< [s] of the last sample
  double resolution = 0.0;                      ///< [Hz] between lines before they were joined
  double step = 0.0;                            ///< [Hz] line k stands for k * step up to (k + 1) * step
  std::array<std::vector<float>, 3> amplitude;  ///< [N] fx, fy, fz
};

class SpectrumMaker {
 public:
  /// @throws Error on a parameter out of its bounds.
  explicit SpectrumMaker(const SpectrumParameters& parameters);

  /// A jump in the running index or another rate begins anew; NaN counts as 0.
  void push(const ForceBlock& block);
  /// Of the newest stretch; empty: it is not whole, or nothing new came since the last call.
  std::optional<ForceSpectrum> take();

 private:
  SpectrumParameters parameters_;
  std::vector<double> window_;
  std::array<std::vector<double>, 3> ring_;
  std::size_t next_ = 0, held_ = 0;
  std::uint64_t expected_ = 0;  // index of the next sample
  double rate_ = 0.0, stamp_ = 0.0;
  bool news_ = false;
};

}  // namespace smartmill::panel
