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
                 "newest samples that are transformed; 8192 at 25.6 kHz resolve 3.1 Hz");
    table.number("spectrum_lines", lines, "1", Range::closed(8, 16384),
                 "most lines of a message, each the maximum of neighbouring lines");
    table.number("spectrum_highest", highest, "Hz", Range::positive(), "highest frequency of a message");
  }
};

/// Amplitude spectrum of the newest samples, Hann window, mean removed. A sine has its amplitude (exactly on
/// a line, up to 15 % less between two lines). Neighbouring lines are reduced to their maximum, so that no
/// peak is lost.
struct ForceSpectrum {
  double stamp = 0.0;                           ///< [s] of the last sample
  double resolution = 0.0;                      ///< [Hz] line spacing before the reduction
  double step = 0.0;                            ///< [Hz] line k covers k * step to (k + 1) * step
  std::array<std::vector<float>, 3> amplitude;  ///< [N] fx, fy, fz
};

class SpectrumMaker {
 public:
  /// @throws Error on a parameter out of its bounds.
  explicit SpectrumMaker(const SpectrumParameters& parameters);

  /// A jump of the running index or a new sample rate resets the buffer; NaN counts as 0.
  void push(const ForceBlock& block);
  /// Spectrum of the newest samples; empty: the buffer is not full, or no new samples since the last call.
  std::optional<ForceSpectrum> take();

 private:
  SpectrumParameters parameters_;
  std::vector<double> window_;
  std::array<std::vector<double>, 3> ring_;
  std::size_t next_ = 0, available_ = 0;
  std::uint64_t expected_ = 0;  // index of the next sample
  double rate_ = 0.0, stamp_ = 0.0;
  bool has_new_samples_ = false;
};

}  // namespace smartmill::panel
