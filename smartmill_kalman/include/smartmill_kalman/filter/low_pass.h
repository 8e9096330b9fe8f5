#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace smartmill::kalman {

/// Butterworth low-pass of fourth order (two second-order sections, bilinear transform with the corner
/// prewarped). Causal: late by delay() at low frequencies. Nothing is allocated a sample.
class LowPass {
 public:
  /// @param corner [Hz] -3 dB, 0 < corner < sample_rate / 2 @param sample_rate [Hz]. @throws Error.
  LowPass(double corner, double sample_rate);

  /// Takes a sample and gives one of the same unit. After reset() the first sample is taken for the level
  /// before. One that is not a number gives NaN and starts the filter anew.
  double step(double sample);
  void reset() { started_ = false; }
  double delay() const { return delay_; }  ///< [samples] group delay at zero frequency

 private:
  struct Section {
    double b0 = 0.0, b1 = 0.0, b2 = 0.0, a1 = 0.0, a2 = 0.0;
    double s1 = 0.0, s2 = 0.0;
  };
  std::array<Section, 2> sections_;
  double delay_ = 0.0;
  bool started_ = false;
};

/// The same filter forwards and backwards: no delay, the magnitude squared (-6 dB at the corner). Ends are
/// continued by point reflection.
std::vector<double> zeroPhaseLowPass(const std::vector<double>& signal, double corner, double sample_rate);

}  // namespace smartmill::kalman
