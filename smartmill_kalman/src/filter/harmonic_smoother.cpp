#include "smartmill_kalman/filter/harmonic_smoother.h"

#include "avx2_clones.h"

namespace smartmill::kalman {

// lambda(k) = c' nu / S + (I - c' K') Phi' lambda(k + 1); force smoothed = force predicted + (P d')' lambda.
AVX2_AND_DEFAULT double HarmonicSmoother::backward(std::size_t level, double innovation, bool is_measured,
                                                   std::vector<GainBatch>& lambda) const {
  const std::vector<GainBatch>&gain = gains[level], &smooth = smoothing[level];
  HarmonicPairs::Vector4 through = {}, correction = {};
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    const HarmonicPairs::PairBatch& batch = batches[i];
    const HarmonicPairs::Vector4 re = lambda[i].re, im = lambda[i].im;
    lambda[i].re = batch.a * re + batch.b * im;
    lambda[i].im = batch.a * im - batch.b * re;
    through += gain[i].re * lambda[i].re + gain[i].im * lambda[i].im;
  }
  const double taken = (through[0] + through[2]) + (through[1] + through[3]);
  const double drive = is_measured ? innovation / variance[level] - taken : 0.0;
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    lambda[i].re += batches[i].c1 * drive;
    lambda[i].im += batches[i].c2 * drive;
    correction += smooth[i].re * lambda[i].re + smooth[i].im * lambda[i].im;
  }
  return (correction[0] + correction[2]) + (correction[1] + correction[3]);
}

}  // namespace smartmill::kalman
