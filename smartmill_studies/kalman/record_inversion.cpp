#include "kalman/record_inversion.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_kalman/filter/matrix_inverse.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;

/// Element of the matrix on the lines of a longer transform: the zero-padded impulse response. Lines above
/// the band are faded out, since the taps do not excite them.
std::vector<Complex> onLines(const std::vector<Complex>& element, double spacing, double bandwidth,
                             std::size_t length) {
  const std::size_t samples = 2 * (element.size() - 1);
  std::vector<Complex> faded = element;
  for (std::size_t l = 0; l < faded.size(); ++l) {
    const double f = spacing * static_cast<double>(l);
    faded[l] *= fadeOut((f / bandwidth - 1.2) / 0.3);
  }
  faded.back() = faded.back().real();
  const std::vector<double> impulse = inverseFourier(faded, samples);
  std::vector<double> longer(length, 0.0);
  const std::size_t early = samples / 8;  // fading makes the response slightly acausal
  std::copy(impulse.begin(), impulse.end() - static_cast<std::ptrdiff_t>(early), longer.begin());
  std::copy(impulse.end() - static_cast<std::ptrdiff_t>(early), impulse.end(),
            longer.end() - static_cast<std::ptrdiff_t>(early));
  return fourier(longer);
}

/// Misfit of the rigid-body model of the sensor.
constexpr double RIGID = 1.5;

/// Forward matrix, scaled, on the lines of a transform of a longer record.
struct LongMatrix {
  Index channels;
  std::vector<std::vector<Complex>> elements;  // row by row, [line]
  std::vector<double> floor;                   // [1] variance of an element on the matrix' own lines

  LongMatrix(const TransferMatrix& matrix, const Eigen::VectorXd& scale, double bandwidth, std::size_t length)
      : channels(scale.size()), floor(matrix.frequency.size(), 0.0) {
    for (Index i = 0; i < channels; ++i) {
      for (Index j = 0; j < channels; ++j) {
        std::vector<Complex> element;
        for (std::size_t l = 0; l < floor.size(); ++l) {
          element.push_back(matrix.forward[l](i, j) * scale(j) / scale(i));
          floor[l] +=
              std::pow(matrix.forward_std[l](i, j) * scale(j) / scale(i), 2) / static_cast<double>(channels);
        }
        elements.push_back(onLines(element, matrix.frequency[1], bandwidth, length));
      }
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

/// Inverse of a rigid body on force-measuring feet: (K + i w C - w^2 M) (K + i w C)^-1 = I - w^2 M Z^-1, Z =
/// K + i w C nearly real. Each element is 1 or 0 at frequency zero, plus a real polynomial in w^2 and w^4 and
/// an imaginary one in w^3 and w^5: four coefficients fitted to all lines.
class RigidInverse {
 public:
  /// @param bandwidth [Hz] highest fitted line
  RigidInverse(const TransferMatrix& matrix, const Eigen::VectorXd& scale, double bandwidth)
      : size_(scale.size()), unit_(bandwidth) {
    for (Index i = 0; i < size_; ++i) {
      for (Index j = 0; j < size_; ++j) {
        std::vector<Line> lines;
        const double scaled = scale(j) / scale(i);
        for (std::size_t l = 1; l < matrix.frequency.size() && matrix.frequency[l] <= bandwidth; ++l) {
          const double std_dev = matrix.inverse_std[l](i, j) * scaled;
          const Complex value = matrix.inverse[l](i, j) * scaled - (i == j ? 1.0 : 0.0);
          if (std_dev > 0.0) lines.push_back({matrix.frequency[l] / unit_, 1.0 / std_dev, value});
        }
        elements_.push_back({fit(lines, 0), fit(lines, 1)});
        for (const Line& line : lines)
          squares_ += std::norm((line.value - value(elements_.back(), line.u)) * line.weight);
        count_ += static_cast<double>(lines.size());
      }
    }
  }

  /// Mean square of the residual over the variance of the lines: 1 for a rigid body.
  double misfit() const { return count_ > 0.0 ? squares_ / count_ : HUGE_VAL; }
  MatrixXcd at(double frequency) const {
    MatrixXcd here = MatrixXcd::Identity(size_, size_);
    for (Index i = 0; i < size_; ++i) {
      for (Index j = 0; j < size_; ++j)
        here(i, j) += value(elements_[static_cast<std::size_t>(i * size_ + j)], frequency / unit_);
    }
    return here;
  }

 private:
  struct Line {
    double u, weight;  // [1] frequency over the bandwidth
    Complex value;
  };
  using Element = std::array<Eigen::VectorXd, 2>;  // of the real part, of the imaginary

  static Eigen::Vector2d powers(double u, std::size_t part) {
    return (part == 0 ? 1.0 : u) * Eigen::Vector2d(u * u, u * u * u * u);
  }
  static Complex value(const Element& element, double u) {
    return {powers(u, 0).dot(element[0]), powers(u, 1).dot(element[1])};
  }
  static Eigen::VectorXd fit(const std::vector<Line>& lines, std::size_t part) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(2, 2);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(2);
    for (const Line& line : lines) {
      const Eigen::Vector2d row = line.weight * powers(line.u, part);
      normal += row * row.transpose();
      right += row * line.weight * (part == 0 ? line.value.real() : line.value.imag());
    }
    return linear::solveSymmetric(normal, right);
  }

  Index size_;
  double unit_;                    // [Hz]
  std::vector<Element> elements_;  // row by row
  double squares_ = 0.0, count_ = 0.0;
};

/// @throws Error on another number of channels or rate, or when the matrix is only a band.
void checkFits(const TransferMatrix& matrix, const std::vector<std::vector<double>>& measured,
               double sample_rate) {
  if (measured.size() != matrix.channels || matrix.frequency.size() < 2 || matrix.frequency.front() != 0.0) {
    throw Error("transfer matrix: " + std::to_string(measured.size()) + " records, " +
                std::to_string(matrix.channels) + " and all lines of the matrix are required");
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
  // Zero padding for the ringing of the inverse, to avoid circular wrap-around.
  std::size_t length = 1;
  while (length < samples + 2 * lines) length *= 2;
  std::vector<std::vector<Complex>> spectra;
  for (std::vector<double> record : measured) {
    record.resize(length, 0.0);
    spectra.push_back(fourier(record));
  }
  const Eigen::VectorXd scale = matrix.scale();
  const LongMatrix forward(matrix, scale, bandwidth, length);
  const RigidInverse rigid(matrix, scale, bandwidth);
  const auto inverted = [&](std::size_t line, double f, const Eigen::VectorXcd& m) -> Eigen::VectorXcd {
    if (rigid.misfit() < RIGID) return rigid.at(f) * m;
    const MatrixXcd here = forward.at(line);
    const double unknown = forward.floor[std::min(lines - 1, static_cast<std::size_t>(f / spacing + 0.5))];
    const MatrixXcd square = here.adjoint() * here + unknown * MatrixXcd::Identity(size, size);
    return linear::solveSymmetric(square, Eigen::VectorXcd(here.adjoint() * m));
  };
  for (std::size_t i = 0; i < spectra.front().size(); ++i) {
    const double f = sample_rate * static_cast<double>(i) / static_cast<double>(length);
    const double weight = fadeOut((f / bandwidth - 1.0) / MatrixInverseParameters().roll_off);
    Eigen::VectorXcd m = Eigen::VectorXcd::Zero(size);
    if (weight > 0.0) {
      for (Index c = 0; c < size; ++c) m(c) = spectra[static_cast<std::size_t>(c)][i] / scale(c);
      m = weight * inverted(i, f, m);
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
