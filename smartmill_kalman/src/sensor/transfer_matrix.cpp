#include "smartmill_kalman/sensor/transfer_matrix.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

constexpr Index SMOOTH = 8;         // lines to each side that share a residual variance
constexpr double FULL_RANK = 1e-6;  // [1] smallest over largest singular value of the directions tapped

/// Force and moment of a unit blow (eq. 2.2, 2.6), moments over the lever.
Eigen::VectorXd blow(const MatrixTap& tap, Index channels, double lever) {
  const Eigen::Vector3d n =
      Eigen::Vector3d(tap.direction[0], tap.direction[1], tap.direction[2]).normalized();
  const Eigen::Vector3d r(tap.point[0], tap.point[1], tap.point[2]);
  Eigen::VectorXd e(channels);
  e.head<3>() = n;
  if (channels == 6) {
    const auto turn = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
      return Eigen::Vector3d(a(1) * b(2) - a(2) * b(1), a(2) * b(0) - a(0) * b(2), a(0) * b(1) - a(1) * b(0));
    };
    e.tail<3>() = turn(r, n) / lever;
  }
  return e;
}

MatrixXcd pseudoInverse(const MatrixXcd& m) {  // of full row rank (eq. 2.4)
  const MatrixXcd square = m * m.adjoint();
  return m.adjoint() * square.ldlt().solve(MatrixXcd::Identity(m.rows(), m.rows()));
}

void check(const std::vector<MatrixTap>& taps) {
  if (taps.empty()) throw Error("transfer matrix: no taps");
  const std::size_t channels = taps.front().channels.size(), samples = taps.front().hammer.size();
  if (channels != 3 && channels != 6) {
    throw Error("transfer matrix: " + std::to_string(channels) + " channels, 3 or 6 are due");
  }
  if (taps.size() < channels) {
    throw Error("transfer matrix: " + std::to_string(taps.size()) + " taps, " + std::to_string(channels) +
                " at least are due");
  }
  for (std::size_t k = 0; k < taps.size(); ++k) {
    const std::string what = "transfer matrix: tap " + std::to_string(k + 1);
    const auto& d = taps[k].direction;
    if (!(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] > 0.0)) throw Error(what + ": no direction");
    if (taps[k].channels.size() != channels) throw Error(what + ": another number of channels");
    if (taps[k].hammer.size() != samples || samples < 64)
      throw Error(what + ": another length, or too short");
    if (firstNotFinite(taps[k].hammer) != samples) throw Error(what + ": hammer: NaN");
    for (const auto& channel : taps[k].channels) {
      if (channel.size() != samples) throw Error(what + ": another length");
      if (firstNotFinite(channel) != samples) throw Error(what + ": NaN");
    }
  }
}

}  // namespace

TransferMatrix TransferMatrix::band(double low, double high) const {
  TransferMatrix result = *this;
  result.frequency.clear();
  result.condition.clear();
  result.forward.clear();
  result.forward_std.clear();
  result.inverse.clear();
  result.inverse_std.clear();
  for (std::size_t l = 0; l < frequency.size(); ++l) {
    if (frequency[l] < low || frequency[l] > high) continue;
    result.frequency.push_back(frequency[l]);
    result.condition.push_back(condition[l]);
    result.forward.push_back(forward[l]);
    result.forward_std.push_back(forward_std[l]);
    result.inverse.push_back(inverse[l]);
    result.inverse_std.push_back(inverse_std[l]);
  }
  return result;
}

FrequencyResponse TransferMatrix::element(std::size_t row, std::size_t column) const {
  FrequencyResponse frf;
  frf.frequency = frequency;
  frf.unit = "1";
  frf.averages = hits;
  for (std::size_t l = 0; l < frequency.size(); ++l) {
    frf.value.push_back(forward[l](static_cast<Index>(row), static_cast<Index>(column)));
    frf.std_dev.push_back(forward_std[l](static_cast<Index>(row), static_cast<Index>(column)));
  }
  return frf;
}

TransferMatrix identifyTransferMatrix(const std::vector<MatrixTap>& taps, double sample_rate) {
  check(taps);
  const auto channels = static_cast<Index>(taps.front().channels.size());
  const auto hits = static_cast<Index>(taps.size());
  const std::size_t samples = taps.front().hammer.size();

  TransferMatrix result;
  result.channels = static_cast<std::size_t>(channels);
  result.hits = static_cast<int>(hits);
  result.frequency = fourierFrequencies(samples, sample_rate);
  const std::size_t lines = result.frequency.size();
  double distance = 0.0;
  for (const MatrixTap& tap : taps) {
    for (const double p : tap.point) distance += p * p;
  }
  result.lever = std::max(1e-3, std::sqrt(distance / static_cast<double>(hits)));

  // Scaled: moments over the lever, so that a condition number means something.
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(channels);
  if (channels == 6) scale.tail<3>().setConstant(result.lever);
  MatrixXd blows(channels, hits);
  for (Index k = 0; k < hits; ++k)
    blows.col(k) = blow(taps[static_cast<std::size_t>(k)], channels, result.lever);
  const Eigen::VectorXd values = Eigen::JacobiSVD<MatrixXd>(blows).singularValues();
  if (!(values(channels - 1) > FULL_RANK * values(0))) {
    throw Error(channels == 6 ? "transfer matrix: the taps do not press along and turn about every axis"
                              : "transfer matrix: the taps do not press along every axis");
  }

  std::vector<std::vector<Complex>> hammer;                 // [tap][line]
  std::vector<std::vector<std::vector<Complex>>> measured;  // [tap][channel][line]
  MatrixXd noise(channels, hits);                           // [N^2 samples] of a line
  for (Index k = 0; k < hits; ++k) {
    const MatrixTap& tap = taps[static_cast<std::size_t>(k)];
    const std::vector<double> window = impactWindow(tap.hammer);
    std::size_t before = 0;
    while (before < samples && window[before] == 0.0) ++before;
    const auto level = [before](const std::vector<double>& v) {
      double sum = 0.0;
      for (std::size_t i = 0; i < before; ++i) sum += v[i];
      return before > 0 ? sum / static_cast<double>(before) : 0.0;
    };
    std::vector<double> force = tap.hammer;
    const double hammer_level = level(force);
    for (std::size_t i = 0; i < samples; ++i) force[i] = (force[i] - hammer_level) * window[i];
    hammer.push_back(fourier(force));
    measured.emplace_back();
    for (Index c = 0; c < channels; ++c) {
      std::vector<double> response = tap.channels[static_cast<std::size_t>(c)];
      const double base = level(response);
      double squares = 0.0;
      for (double& v : response) v = (v - base) / scale(c);
      for (std::size_t i = 0; i < before; ++i) squares += response[i] * response[i];
      noise(c, k) =
          before > 1 ? squares / static_cast<double>(before - 1) * static_cast<double>(samples) : 0.0;
      measured.back().push_back(fourier(response));
    }
  }

  // First what each line leaves over, then its standard deviations.
  MatrixXd left(channels, static_cast<Index>(lines));
  std::vector<MatrixXcd> applied_inverse, scaled;
  for (std::size_t l = 0; l < lines; ++l) {
    MatrixXcd e(channels, hits), m(channels, hits);
    for (Index k = 0; k < hits; ++k) {
      e.col(k) = blows.col(k) * hammer[static_cast<std::size_t>(k)][l];
      for (Index c = 0; c < channels; ++c)
        m(c, k) = measured[static_cast<std::size_t>(k)][static_cast<std::size_t>(c)][l];
    }
    const MatrixXcd square = e * e.adjoint();
    applied_inverse.push_back(square.ldlt().solve(MatrixXcd::Identity(channels, channels)));
    scaled.push_back(m * e.adjoint() * applied_inverse.back());
    left.col(static_cast<Index>(l)) = (m - scaled.back() * e).rowwise().squaredNorm();
    result.inverse.push_back(scale.asDiagonal() * (e * pseudoInverse(m)) * scale.cwiseInverse().asDiagonal());
  }
  const double free = static_cast<double>(hits - channels);
  const Eigen::VectorXd before_hits = noise.rowwise().mean();
  for (std::size_t l = 0; l < lines; ++l) {
    const auto at = static_cast<Index>(l), from = std::max<Index>(0, at - SMOOTH);
    const Index count = std::min(static_cast<Index>(lines), at + SMOOTH + 1) - from;
    Eigen::VectorXd variance = before_hits;
    if (free > 0.0) variance = variance.cwiseMax(left.middleCols(from, count).rowwise().mean() / free);
    MatrixXd std_dev(channels, channels);
    for (Index i = 0; i < channels; ++i) {
      for (Index j = 0; j < channels; ++j)
        std_dev(i, j) = std::sqrt(variance(i) * std::max(0.0, applied_inverse[l](j, j).real()));
    }
    // d(G^-1) = -G^-1 dG G^-1; G's columns in one row share their noise: covariance of row i is variance(i)
    // times the inverse of E E'.
    const MatrixXcd h = scale.cwiseInverse().asDiagonal() * result.inverse[l] * scale.asDiagonal();
    const MatrixXcd right = h.adjoint() * applied_inverse[l] * h;
    MatrixXd inverse_std(channels, channels);
    for (Index i = 0; i < channels; ++i) {
      const double rows = (h.row(i).cwiseAbs2().transpose().array() * variance.array()).sum();
      for (Index j = 0; j < channels; ++j)
        inverse_std(i, j) = std::sqrt(std::max(0.0, rows * right(j, j).real()));
    }
    const Eigen::VectorXd singular = Eigen::JacobiSVD<MatrixXcd>(scaled[l]).singularValues();
    result.condition.push_back(singular(channels - 1) > 0.0 ? singular(0) / singular(channels - 1)
                                                            : HUGE_VAL);
    const auto backScaled = [&scale](const auto& matrix) {
      return (scale.asDiagonal() * matrix * scale.cwiseInverse().asDiagonal()).eval();
    };
    result.forward.push_back(backScaled(scaled[l]));
    result.forward_std.push_back(backScaled(std_dev));
    result.inverse_std.push_back(backScaled(inverse_std));
  }
  return result;
}

namespace {

/// Element of the matrix on the lines of a longer transform: the impulse response, with nothing between its
/// end and its beginning. Lines above the band are faded out, for no tap has told them.
std::vector<Complex> onLines(const std::vector<Complex>& element, double spacing, double bandwidth,
                             std::size_t length) {
  const std::size_t samples = 2 * (element.size() - 1);
  std::vector<Complex> faded = element;
  for (std::size_t l = 0; l < faded.size(); ++l) {
    const double f = spacing * static_cast<double>(l);
    const double beyond = std::clamp((f / bandwidth - 1.2) / 0.3, 0.0, 1.0);
    faded[l] *= 0.5 * (1.0 + std::cos(units::PI * beyond));
  }
  faded.back() = faded.back().real();
  const std::vector<double> impulse = inverseFourier(faded, samples);
  std::vector<double> longer(length, 0.0);
  const std::size_t early = samples / 8;  // fading leaves a little before the beginning
  std::copy(impulse.begin(), impulse.end() - static_cast<std::ptrdiff_t>(early), longer.begin());
  std::copy(impulse.end() - static_cast<std::ptrdiff_t>(early), impulse.end(),
            longer.end() - static_cast<std::ptrdiff_t>(early));
  return fourier(longer);
}

}  // namespace

std::vector<std::vector<double>> invertRecord(const TransferMatrix& matrix,
                                              const std::vector<std::vector<double>>& measured,
                                              double sample_rate, double bandwidth) {
  const std::size_t channels = matrix.channels;
  const auto size = static_cast<Index>(channels);
  if (measured.size() != channels || matrix.frequency.size() < 2 || matrix.frequency.front() != 0.0) {
    throw Error("transfer matrix: " + std::to_string(measured.size()) + " records, " +
                std::to_string(channels) + " and all lines of the matrix are due");
  }
  const std::size_t samples = measured.front().size(), lines = matrix.frequency.size();
  const double spacing = matrix.frequency[1];
  // Behind the record room for what the inverse rings, so that the end does not come round to the beginning.
  std::size_t length = 1;
  while (length < samples + 2 * lines) length *= 2;
  if (std::abs(spacing * 2.0 * static_cast<double>(lines - 1) / sample_rate - 1.0) > 1e-9)
    throw Error("transfer matrix: taps and record need one sample rate and taps an even number of samples");
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(size);
  if (channels == 6) scale.tail<3>().setConstant(matrix.lever);
  std::vector<std::vector<Complex>> spectra, g;
  for (std::vector<double> record : measured) {
    if (record.size() != samples) throw Error("transfer matrix: records of different lengths");
    record.resize(length, 0.0);
    spectra.push_back(fourier(record));
  }
  std::vector<double> floor(lines, 0.0);
  for (Index i = 0; i < size; ++i) {
    for (Index j = 0; j < size; ++j) {
      std::vector<Complex> element;
      for (std::size_t l = 0; l < lines; ++l) {
        element.push_back(matrix.forward[l](i, j) * scale(j) / scale(i));
        floor[l] +=
            std::pow(matrix.forward_std[l](i, j) * scale(j) / scale(i), 2) / static_cast<double>(size);
      }
      g.push_back(onLines(element, spacing, bandwidth, length));
    }
  }
  for (std::size_t i = 0; i < g.front().size(); ++i) {
    const double f = sample_rate * static_cast<double>(i) / static_cast<double>(length);
    const double beyond = std::clamp((f / bandwidth - 1.0) / 0.15, 0.0, 1.0);
    const double weight = 0.5 * (1.0 + std::cos(units::PI * beyond));
    Eigen::VectorXcd m(size);
    MatrixXcd here(size, size);
    for (Index c = 0; c < size; ++c) {
      m(c) = spectra[static_cast<std::size_t>(c)][i] / scale(c);
      for (Index j = 0; j < size; ++j) here(c, j) = g[static_cast<std::size_t>(c * size + j)][i];
    }
    if (weight <= 0.0) {
      m.setZero();
    } else {
      const double unknown = floor[std::min(lines - 1, static_cast<std::size_t>(f / spacing + 0.5))];
      const MatrixXcd square = here.adjoint() * here + unknown * MatrixXcd::Identity(size, size);
      m = weight * square.ldlt().solve(here.adjoint() * m);
    }
    for (Index c = 0; c < size; ++c) spectra[static_cast<std::size_t>(c)][i] = m(c) * scale(c);
  }
  std::vector<std::vector<double>> applied;
  for (const auto& spectrum : spectra) {
    applied.push_back(inverseFourier(spectrum, length));
    applied.back().resize(samples);
  }
  return applied;
}

std::array<double, 2> pointOfApplication(const std::array<double, 3>& force,
                                         const std::array<double, 3>& moment, double z) {
  // M_x = y F_z - z F_y, M_y = z F_x - x F_z
  const double largest = std::max({std::abs(force[0]), std::abs(force[1]), std::abs(force[2])});
  if (!(std::abs(force[2]) > 1e-6 * largest)) return {std::nan(""), std::nan("")};
  return {(z * force[0] - moment[1]) / force[2], (moment[0] + z * force[1]) / force[2]};
}

}  // namespace smartmill::kalman
