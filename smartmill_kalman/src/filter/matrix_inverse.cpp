#include "smartmill_kalman/filter/matrix_inverse.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;

constexpr std::size_t FORCES = 3;  // rows: x, y, z

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

FirDesign designOf(const TransferMatrix& matrix, const MatrixInverseParameters& parameters) {
  if (matrix.frequency.size() < 2 || matrix.frequency.front() != 0.0)
    throw Error("transfer matrix: a band, expected all lines from 0 Hz");
  FirDesign design;
  design.samples = design.taps = 2 * (matrix.frequency.size() - 1);
  design.sample_rate = matrix.frequency[1] * static_cast<double>(design.samples);
  design.latency =
      std::min(static_cast<std::size_t>(parameters.latency * design.sample_rate), design.samples / 4);
  return design;
}

std::vector<std::vector<double>> inverseTaps(const TransferMatrix& matrix, const FirDesign& design,
                                             double bandwidth, double roll_off) {
  const std::size_t lines = matrix.frequency.size(), channels = matrix.channels;
  const Eigen::VectorXd scale = matrix.scale();
  std::vector<std::vector<Complex>> response(FORCES * channels, std::vector<Complex>(lines));
  for (std::size_t l = 0; l < lines; ++l) {
    const double f = matrix.frequency[1] * static_cast<double>(l);
    const double weight = fadeOut((f / bandwidth - 1.0) / roll_off);
    if (!(weight > 0.0)) continue;
    const MatrixXcd inverse = inverseAt(matrix, l, scale);
    const Complex late = design.late(f, weight);
    for (std::size_t i = 0; i < FORCES; ++i) {
      for (std::size_t j = 0; j < channels; ++j)
        response[i * channels + j][l] = late * inverse(static_cast<Index>(i), static_cast<Index>(j));
    }
  }
  std::vector<std::vector<double>> taps;
  for (std::vector<Complex>& element : response) {
    element.front() = element.front().real();
    element.back() = element.back().real();
    taps.push_back(design.tapsOf(element));
  }
  return taps;
}

}  // namespace

MatrixInverse::MatrixInverse(const TransferMatrix& matrix, double bandwidth,
                             const MatrixInverseParameters& parameters)
    : design_(designOf(matrix, parameters)),
      filters_(matrix.channels, inverseTaps(matrix, design_, bandwidth, parameters.roll_off)) {
}

std::vector<std::vector<double>> MatrixInverse::process(const std::vector<std::vector<double>>& samples) {
  if (samples.size() != channels()) {
    throw Error("transfer matrix: " + std::to_string(samples.size()) + " channels, expected " +
                std::to_string(channels()));
  }
  return filters_.process(samples);
}

}  // namespace smartmill::kalman
