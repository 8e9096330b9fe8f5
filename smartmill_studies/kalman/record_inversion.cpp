#include "kalman/record_inversion.h"

#include <algorithm>
#include <cmath>
#include <complex>
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

constexpr double CHANCE = 1.5;  // [1] by which the noise of a stretch exceeds its mean now and then

/// Impulse response of an element. Lines above the band are faded out, for no tap has told them.
std::vector<double> impulseOf(const std::vector<Complex>& element, double spacing, double bandwidth) {
  const std::size_t samples = 2 * (element.size() - 1);
  std::vector<Complex> faded = element;
  for (std::size_t l = 0; l < faded.size(); ++l) {
    const double f = spacing * static_cast<double>(l);
    const double beyond = std::clamp((f / bandwidth - 1.2) / 0.3, 0.0, 1.0);
    faded[l] *= 0.5 * (1.0 + std::cos(units::PI * beyond));
  }
  faded.back() = faded.back().real();
  return inverseFourier(faded, samples);
}

/// What rings has died away long before a tap's record ends; the rest is the taps' noise. Share of the
/// impulse responses, all elements together, that is no noise, over time.
std::vector<double> ringing(const std::vector<std::vector<double>>& impulses) {
  constexpr std::size_t STEP = 64;  // samples
  const std::size_t samples = impulses.front().size(), steps = samples / STEP;
  std::vector<double> power(steps, 0.0);
  for (const std::vector<double>& impulse : impulses) {
    for (std::size_t i = 0; i < steps * STEP; ++i) power[i / STEP] += impulse[i] * impulse[i];
  }
  // The quietest quarter of the record is noise; what stands in it by chance is not counted twice.
  std::vector<double> sorted = power;
  std::sort(sorted.begin(), sorted.end());
  double noise = 0.0;
  for (std::size_t k = 0; k < steps / 4; ++k) noise += sorted[k] / static_cast<double>(steps / 4);
  std::vector<double> share(samples, 0.0);
  for (std::size_t i = 0; i < steps * STEP; ++i) {
    const double signal = std::max(0.0, power[i / STEP] - CHANCE * noise);
    share[i] = signal / (signal + noise);
  }
  return share;
}

/// An impulse response on the lines of a longer transform, with nothing between its end and its beginning.
std::vector<Complex> onLines(const std::vector<double>& impulse, std::size_t length) {
  const std::size_t samples = impulse.size();
  std::vector<double> longer(length, 0.0);
  const std::size_t early = samples / 8;  // fading leaves a little before the beginning
  std::copy(impulse.begin(), impulse.end() - static_cast<std::ptrdiff_t>(early), longer.begin());
  std::copy(impulse.end() - static_cast<std::ptrdiff_t>(early), impulse.end(),
            longer.end() - static_cast<std::ptrdiff_t>(early));
  return fourier(longer);
}

/// 1 up to the bandwidth, 0 from 1.15 times it on.
double passed(double frequency, double bandwidth) {
  const double beyond = std::clamp((frequency / bandwidth - 1.0) / 0.15, 0.0, 1.0);
  return 0.5 * (1.0 + std::cos(units::PI * beyond));
}

/// Forward matrix, scaled, on the lines of a transform of a longer record.
struct LongMatrix {
  Index channels;
  std::vector<std::vector<Complex>> elements;  // row by row, [line]
  std::vector<double> floor;                   // [1] variance of an element on the matrix' own lines

  LongMatrix(const TransferMatrix& matrix, const Eigen::VectorXd& scale, double bandwidth, std::size_t length)
      : channels(scale.size()), floor(matrix.frequency.size(), 0.0) {
    std::vector<std::vector<double>> impulses;
    for (Index i = 0; i < channels; ++i) {
      for (Index j = 0; j < channels; ++j) {
        std::vector<Complex> element;
        for (std::size_t l = 0; l < floor.size(); ++l) {
          element.push_back(matrix.forward[l](i, j) * scale(j) / scale(i));
          floor[l] +=
              std::pow(matrix.forward_std[l](i, j) * scale(j) / scale(i), 2) / static_cast<double>(channels);
        }
        impulses.push_back(impulseOf(element, matrix.frequency[1], bandwidth));
      }
    }
    const std::vector<double> share = ringing(impulses);
    double kept = 0.0;
    for (const double s : share) kept += s * s / static_cast<double>(share.size());
    for (double& variance : floor) variance *= kept;
    for (std::vector<double>& impulse : impulses) {
      for (std::size_t i = 0; i < impulse.size(); ++i) impulse[i] *= share[i];
      elements.push_back(onLines(impulse, length));
    }
  }
  MatrixXcd at(std::size_t line) const {
    MatrixXcd here(channels, channels);
    for (Index i = 0; i < channels; ++i) {
      for (Index j = 0; j < channels; ++j)
        here(i, j) = elements[static_cast<std::size_t>(i * channels + j)][line];
    }
    return here;
  }
};

/// @throws Error on another number of channels or rate, or when the matrix is only a band.
void checkFits(const TransferMatrix& matrix, const std::vector<std::vector<double>>& measured,
               double sample_rate) {
  if (measured.size() != matrix.channels || matrix.frequency.size() < 2 || matrix.frequency.front() != 0.0) {
    throw Error("transfer matrix: " + std::to_string(measured.size()) + " records, " +
                std::to_string(matrix.channels) + " and all lines of the matrix are due");
  }
  const double top = matrix.frequency[1] * 2.0 * static_cast<double>(matrix.frequency.size() - 1);
  if (std::abs(top / sample_rate - 1.0) > 1e-9)
    throw Error("transfer matrix: taps and record need one sample rate and taps an even number of samples");
  for (const std::vector<double>& record : measured) {
    if (record.size() != measured.front().size())
      throw Error("transfer matrix: records of different lengths");
  }
}

}  // namespace

std::vector<std::vector<double>> invertRecord(const TransferMatrix& matrix,
                                              const std::vector<std::vector<double>>& measured,
                                              double sample_rate, double bandwidth) {
  checkFits(matrix, measured, sample_rate);
  const auto size = static_cast<Index>(matrix.channels);
  const std::size_t samples = measured.front().size(), lines = matrix.frequency.size();
  const double spacing = matrix.frequency[1];
  // Behind the record room for what the inverse rings, so that the end does not come round to the beginning.
  std::size_t length = 1;
  while (length < samples + 2 * lines) length *= 2;
  std::vector<std::vector<Complex>> spectra;
  for (std::vector<double> record : measured) {
    record.resize(length, 0.0);
    spectra.push_back(fourier(record));
  }
  const Eigen::VectorXd scale = matrix.scale();
  const LongMatrix forward(matrix, scale, bandwidth, length);
  for (std::size_t i = 0; i < spectra.front().size(); ++i) {
    const double f = sample_rate * static_cast<double>(i) / static_cast<double>(length);
    const double weight = passed(f, bandwidth);
    Eigen::VectorXcd m = Eigen::VectorXcd::Zero(size);
    if (weight > 0.0) {
      for (Index c = 0; c < size; ++c) m(c) = spectra[static_cast<std::size_t>(c)][i] / scale(c);
      const MatrixXcd here = forward.at(i);
      const double unknown = forward.floor[std::min(lines - 1, static_cast<std::size_t>(f / spacing + 0.5))];
      const MatrixXcd square = here.adjoint() * here + unknown * MatrixXcd::Identity(size, size);
      m = weight * linear::solveSymmetric(square, Eigen::VectorXcd(here.adjoint() * m));
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
