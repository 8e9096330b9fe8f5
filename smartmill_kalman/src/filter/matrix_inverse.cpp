#include "smartmill_kalman/filter/matrix_inverse.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;

constexpr double ROLL_OFF = 0.15;  // [1] of the bandwidth, over which it ends
constexpr double LATENCY = 0.01;   // [s] for the non-causal part
constexpr std::size_t TAIL = 8;    // an eighth of the taps is tapered
constexpr std::size_t FORCES = 3;  // rows: x, y, z

/// 1 up to the bandwidth, 0 from 1 + ROLL_OFF times it on.
double passed(double frequency, double bandwidth) {
  const double beyond = std::clamp((frequency / bandwidth - 1.0) / ROLL_OFF, 0.0, 1.0);
  return 0.5 * (1.0 + std::cos(units::PI * beyond));
}

/// Regularised inverse at a line: the floor is the variance of the matrix.
MatrixXcd inverseAt(const TransferMatrix& matrix, std::size_t line, const Eigen::VectorXd& scale) {
  const Index n = scale.size();
  MatrixXcd forward(n, n);
  double unknown = 0.0;
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      forward(i, j) = matrix.forward[line](i, j) * scale(j) / scale(i);
      unknown += std::pow(matrix.forward_std[line](i, j) * scale(j) / scale(i), 2) / static_cast<double>(n);
    }
  }
  const MatrixXcd square = forward.adjoint() * forward + unknown * MatrixXcd::Identity(n, n);
  MatrixXcd inverse = linear::solveSymmetric(square, MatrixXcd(forward.adjoint()));
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) inverse(i, j) *= scale(i) / scale(j);
  }
  return inverse;
}

}  // namespace

MatrixInverse::MatrixInverse(const TransferMatrix& matrix, double bandwidth) : channels_(matrix.channels) {
  if (matrix.frequency.size() < 2 || matrix.frequency.front() != 0.0)
    throw Error("transfer matrix: a band, expected all lines from 0 Hz");
  const double spacing = matrix.frequency[1];
  const std::size_t lines = matrix.frequency.size(), samples = 2 * (lines - 1);
  sample_rate_ = spacing * static_cast<double>(samples);
  latency_ = std::min(static_cast<std::size_t>(LATENCY * sample_rate_), samples / 4);
  const Eigen::VectorXd scale = matrix.scale();
  std::vector<std::vector<Complex>> response(FORCES * channels_, std::vector<Complex>(lines));
  for (std::size_t l = 0; l < lines; ++l) {
    const double f = spacing * static_cast<double>(l), weight = passed(f, bandwidth);
    if (!(weight > 0.0)) continue;
    const MatrixXcd inverse = inverseAt(matrix, l, scale);
    const Complex late =
        std::polar(weight, -units::TWO_PI * f / sample_rate_ * static_cast<double>(latency_));
    for (std::size_t i = 0; i < FORCES; ++i) {
      for (std::size_t j = 0; j < channels_; ++j)
        response[i * channels_ + j][l] = late * inverse(static_cast<Index>(i), static_cast<Index>(j));
    }
  }
  const std::size_t tail = samples / TAIL;
  for (std::vector<Complex>& element : response) {
    element.front() = element.front().real();
    element.back() = element.back().real();
    taps_.push_back(inverseFourier(element, samples));
    for (std::size_t i = 0; i < tail; ++i) {
      taps_.back()[samples - 1 - i] *=
          0.5 * (1.0 - std::cos(units::PI * static_cast<double>(i) / static_cast<double>(tail)));
    }
  }
  reset();
}

void MatrixInverse::reset() {
  history_.assign(channels_, std::vector<double>(taps_.front().size() - 1, 0.0));
}

void MatrixInverse::transformTaps(std::size_t length) {
  if (length == length_) return;
  length_ = length;
  spectra_.clear();
  for (std::vector<double> padded : taps_) {
    padded.resize(length, 0.0);
    spectra_.push_back(fourier(padded));
  }
}

std::vector<std::vector<double>> MatrixInverse::process(const std::vector<std::vector<double>>& samples) {
  if (samples.size() != channels_) {
    throw Error("transfer matrix: " + std::to_string(samples.size()) + " channels, expected " +
                std::to_string(channels_));
  }
  const std::size_t count = samples.front().size(), before = history_.front().size();
  std::size_t length = 1;  // power of two
  while (length < before + count) length *= 2;
  transformTaps(length);
  std::vector<std::vector<Complex>> sum(FORCES, std::vector<Complex>(length / 2 + 1));
  for (std::size_t j = 0; j < channels_; ++j) {
    std::vector<double> joined = history_[j];
    joined.insert(joined.end(), samples[j].begin(), samples[j].end());
    history_[j].assign(joined.end() - static_cast<std::ptrdiff_t>(before), joined.end());
    joined.resize(length, 0.0);
    const std::vector<Complex> spectrum = fourier(joined);
    for (std::size_t i = 0; i < FORCES; ++i) {
      const std::vector<Complex>& tap = spectra_[i * channels_ + j];
      for (std::size_t l = 0; l < spectrum.size(); ++l) sum[i][l] += tap[l] * spectrum[l];
    }
  }
  std::vector<std::vector<double>> force;
  for (const std::vector<Complex>& spectrum : sum) {
    const std::vector<double> circular = inverseFourier(spectrum, length);
    const auto first = circular.begin() + static_cast<std::ptrdiff_t>(before);
    force.emplace_back(first, first + static_cast<std::ptrdiff_t>(count));
  }
  return force;
}

}  // namespace smartmill::kalman
