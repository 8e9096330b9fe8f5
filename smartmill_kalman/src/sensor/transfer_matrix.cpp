#include "smartmill_kalman/sensor/transfer_matrix.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/modal/impact_analysis.h"
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

constexpr Index RIGID_LINES = 12;        // above 0 Hz: 60 Hz of records of 0.2 s
constexpr double MIN_RANK_RATIO = 1e-6;  // [1] smallest over largest singular value of the directions tapped

/// Force and moment of a unit hit (eq. 2.2, 2.6), moments over the lever.
Eigen::VectorXd unitHit(const MatrixTap& tap, Index channels, double lever) {
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
  return m.adjoint() * linear::inverseSymmetric(square);
}

void check(const std::vector<MatrixTap>& taps) {
  if (taps.empty()) throw Error("transfer matrix: no taps");
  const std::size_t channels = taps.front().channels.size(), samples = taps.front().hammer.size();
  if (channels != 3 && channels != 6) {
    throw Error("transfer matrix: " + std::to_string(channels) + " channels, expected 3 or 6");
  }
  if (taps.size() < channels) {
    throw Error("transfer matrix: " + std::to_string(taps.size()) + " taps, expected at least " +
                std::to_string(channels));
  }
  for (std::size_t k = 0; k < taps.size(); ++k) {
    const std::string what = "transfer matrix: tap " + std::to_string(k + 1);
    const auto& d = taps[k].direction;
    if (!(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] > 0.0)) throw Error(what + ": no direction");
    if (taps[k].channels.size() != channels) throw Error(what + ": number of channels differs from tap 1");
    if (taps[k].hammer.size() != samples || samples < 64)
      throw Error(what + ": length differs from tap 1 or is below 64 samples");
    if (firstNotFinite(taps[k].hammer) != samples) throw Error(what + ": hammer: NaN");
    for (const auto& channel : taps[k].channels) {
      if (channel.size() != samples) throw Error(what + ": length differs from tap 1");
      if (firstNotFinite(channel) != samples) throw Error(what + ": NaN");
    }
  }
}

}  // namespace

Eigen::VectorXd TransferMatrix::scale() const {
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(static_cast<Index>(channels));
  if (channels == 6) scale.tail<3>().setConstant(lever);
  return scale;
}

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

namespace {

template <class Matrix>
Matrix scaledBy(const Eigen::VectorXd& scale, const Matrix& matrix) {
  return scale.asDiagonal() * matrix * scale.cwiseInverse().asDiagonal();
}

/// Forces and moments of every tap over its hammer's force, a column each. @throws Error when they do not
/// span all directions.
MatrixXd unitHitsOf(const std::vector<MatrixTap>& taps, Index channels, double lever) {
  MatrixXd unit_hits(channels, static_cast<Index>(taps.size()));
  for (std::size_t k = 0; k < taps.size(); ++k)
    unit_hits.col(static_cast<Index>(k)) = unitHit(taps[k], channels, lever);
  const Eigen::VectorXd values = linear::singularValues(unit_hits);
  if (!(values(channels - 1) > MIN_RANK_RATIO * values(0))) {
    throw Error(channels == 6 ? "transfer matrix: the taps do not span forces and moments of all axes"
                              : "transfer matrix: the taps do not span the forces of all axes");
  }
  return unit_hits;
}

/// Spectra of all taps, scaled.
struct TapSpectra {
  std::vector<std::vector<Complex>> hammer;                 // [tap][line]
  std::vector<std::vector<std::vector<Complex>>> measured;  // [tap][channel][line]
  MatrixXd noise;                                           // [N^2 samples] of a line; channel, tap

  MatrixXcd applied(const MatrixXd& unit_hits, std::size_t line) const {
    MatrixXcd e(unit_hits.rows(), unit_hits.cols());
    for (Index k = 0; k < e.cols(); ++k)
      e.col(k) = unit_hits.col(k) * hammer[static_cast<std::size_t>(k)][line];
    return e;
  }
  MatrixXcd measuredAt(std::size_t line) const {
    MatrixXcd m(noise.rows(), noise.cols());
    for (Index k = 0; k < m.cols(); ++k) {
      for (Index c = 0; c < m.rows(); ++c)
        m(c, k) = measured[static_cast<std::size_t>(k)][static_cast<std::size_t>(c)][line];
    }
    return m;
  }
};

TapSpectra spectraOf(const std::vector<MatrixTap>& taps, const Eigen::VectorXd& scale) {
  TapSpectra spectra;
  spectra.noise.resize(scale.size(), static_cast<Index>(taps.size()));
  for (std::size_t k = 0; k < taps.size(); ++k) {
    const MatrixTap& tap = taps[k];
    const std::size_t samples = tap.hammer.size();
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
    spectra.hammer.push_back(fourier(force));
    spectra.measured.emplace_back();
    for (Index c = 0; c < scale.size(); ++c) {
      std::vector<double> response = tap.channels[static_cast<std::size_t>(c)];
      const double base = level(response);
      double squares = 0.0;
      for (double& v : response) v = (v - base) / scale(c);
      for (std::size_t i = 0; i < before; ++i) squares += response[i] * response[i];
      spectra.noise(c, static_cast<Index>(k)) =
          before > 1 ? squares / static_cast<double>(before - 1) * static_cast<double>(samples) : 0.0;
      spectra.measured.back().push_back(fourier(response));
    }
  }
  return spectra;
}

/// One line's matrices, scaled.
struct LineFit {
  MatrixXcd forward, inverse;
  MatrixXcd covariance;              // of a row of forward, over the channel's variance: inverse of E E'
  Eigen::VectorXd residual_squares;  // of the hits, each channel
};

LineFit fitLine(const MatrixXcd& e, const MatrixXcd& m) {
  LineFit line;
  const MatrixXcd square = e * e.adjoint();
  line.covariance = linear::inverseSymmetric(square);
  line.forward = m * e.adjoint() * line.covariance;
  line.inverse = e * pseudoInverse(m);
  line.residual_squares = (m - line.forward * e).rowwise().squaredNorm();
  return line;
}

/// Standard deviations of a line's two matrices. @param variance of each channel on the line
std::array<MatrixXd, 2> deviations(const LineFit& line, const Eigen::VectorXd& variance) {
  const Index channels = variance.size();
  MatrixXd forward(channels, channels), inverse(channels, channels);
  // d(G^-1) = -G^-1 dG G^-1; G's columns in one row share their noise: covariance of row i is variance(i)
  // times the inverse of E E'.
  const MatrixXcd right = line.inverse.adjoint() * line.covariance * line.inverse;
  for (Index i = 0; i < channels; ++i) {
    const double rows = (line.inverse.row(i).cwiseAbs2().transpose().array() * variance.array()).sum();
    for (Index j = 0; j < channels; ++j) {
      forward(i, j) = std::sqrt(variance(i) * std::max(0.0, line.covariance(j, j).real()));
      inverse(i, j) = std::sqrt(std::max(0.0, rows * right(j, j).real()));
    }
  }
  return {forward, inverse};
}

/// Variance of each channel on a line: residual variance of the hits on the line and its neighbours, at least
/// that before the hits.
Eigen::VectorXd varianceAt(const std::vector<LineFit>& lines, std::size_t at, const Eigen::VectorXd& before,
                           Index hits) {
  const Index free = hits - before.size();
  if (free <= 0) return before;
  const std::size_t near = ImpactOptions().smooth_lines;
  const std::size_t from = at < near ? 0 : at - near, to = std::min(lines.size(), at + near + 1);
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(before.size());
  for (std::size_t l = from; l < to; ++l) squares += lines[l].residual_squares;
  return before.cwiseMax(squares / static_cast<double>(to - from) / static_cast<double>(free));
}

/// Adds the line at 0 Hz: the real parts of the first lines above it, where the response of a body on springs
/// is G + a f^2, extrapolated. The taps do not give it: the mean of a record is known only as well as the
/// mean of the few samples before the hit.
void addLineAtRest(TransferMatrix& matrix) {
  MatrixXd terms(RIGID_LINES, 2);
  for (Index l = 0; l < RIGID_LINES; ++l) terms.row(l) << 1.0, std::pow(static_cast<double>(l + 1), 2);
  const Eigen::VectorXd weights =
      terms * linear::inverseSymmetric(MatrixXd(terms.transpose() * terms)).col(0);
  const auto sum = [&weights](const auto& lines, const auto& part) {
    auto result = part(lines[0], weights(0));
    for (Index l = 1; l < RIGID_LINES; ++l) result += part(lines[static_cast<std::size_t>(l)], weights(l));
    return result;
  };
  const auto value = [](const MatrixXcd& line, double weight) -> MatrixXcd {
    return weight * line.real().cast<Complex>();
  };
  const auto half_variance = [](const MatrixXd& std_dev, double weight) -> MatrixXd {
    return 0.5 * weight * weight * std_dev.cwiseAbs2();
  };
  const auto put = [](auto& lines, auto line) { lines.insert(lines.begin(), std::move(line)); };
  put(matrix.forward, sum(matrix.forward, value));
  put(matrix.inverse, sum(matrix.inverse, value));
  put(matrix.forward_std, MatrixXd(sum(matrix.forward_std, half_variance).cwiseSqrt()));
  put(matrix.inverse_std, MatrixXd(sum(matrix.inverse_std, half_variance).cwiseSqrt()));
  put(matrix.condition, matrix.condition.front());
}

}  // namespace

TransferMatrix identifyTransferMatrix(const std::vector<MatrixTap>& taps, double sample_rate) {
  check(taps);
  const auto channels = static_cast<Index>(taps.front().channels.size());
  const auto hits = static_cast<Index>(taps.size());
  TransferMatrix result;
  result.channels = static_cast<std::size_t>(channels);
  result.hits = static_cast<int>(hits);
  result.frequency = fourierFrequencies(taps.front().hammer.size(), sample_rate);
  double distance = 0.0;
  for (const MatrixTap& tap : taps) {
    for (const double p : tap.point) distance += p * p;
  }
  result.lever = std::max(1e-3, std::sqrt(distance / static_cast<double>(hits)));
  const Eigen::VectorXd scale = result.scale();
  const MatrixXd unit_hits = unitHitsOf(taps, channels, result.lever);
  const TapSpectra spectra = spectraOf(taps, scale);

  // First the residuals of all lines, then the standard deviations.
  std::vector<LineFit> lines;  // without that at 0 Hz
  for (std::size_t l = 1; l < result.frequency.size(); ++l)
    lines.push_back(fitLine(spectra.applied(unit_hits, l), spectra.measuredAt(l)));
  const Eigen::VectorXd before = spectra.noise.rowwise().mean();
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const auto std_dev = deviations(lines[l], varianceAt(lines, l, before, hits));
    const Eigen::VectorXd singular = linear::singularValues(lines[l].forward);
    result.condition.push_back(singular(channels - 1) > 0.0 ? singular(0) / singular(channels - 1)
                                                            : HUGE_VAL);
    result.forward.push_back(scaledBy(scale, lines[l].forward));
    result.inverse.push_back(scaledBy(scale, lines[l].inverse));
    result.forward_std.push_back(scaledBy(scale, std_dev[0]));
    result.inverse_std.push_back(scaledBy(scale, std_dev[1]));
  }
  addLineAtRest(result);
  return result;
}

}  // namespace smartmill::kalman
