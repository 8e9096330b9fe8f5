#include "solvers/forced_vibration.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::VectorXcd;
using units::PI;
using units::TWO_PI;

constexpr int CELLS = CONTACT.cells;

/// exp(-2 pi i j / CELLS).
Complex rootOfUnity(long j) {
  static const std::vector<Complex> ROOTS = [] {
    std::vector<Complex> roots;
    for (int k = 0; k < CELLS; ++k) roots.push_back(std::polar(1.0, -TWO_PI * k / CELLS));
    return roots;
  }();
  return ROOTS[static_cast<std::size_t>(((j % CELLS) + CELLS) % CELLS)];
}

/// Fourier coefficient j of values in the middles of the cells.
template <class Result, class Value>
Result coefficient(const std::vector<Value>& values, int j) {
  Result sum = Result::Zero();
  for (int i = 0; i < CELLS; ++i)
    sum += rootOfUnity(static_cast<long>(j) * i) * values[static_cast<std::size_t>(i)];
  return sum * std::polar(1.0 / CELLS, -PI * j / CELLS);
}

}  // namespace

/// Harmonic balance: harmonics -most .. most of the forced vibration.
VectorXcd ForcedVibration::balance(const ContactForces& forces, const std::vector<double>& delays,
                                   int most) const {
  const Index n = 2 * most + 1;
  std::vector<std::vector<Eigen::Matrix2cd>> c;  // Fourier coefficients of the gains, -2 most .. 2 most
  for (const auto& gain : forces.gain) {
    c.emplace_back(static_cast<std::size_t>(4 * most + 1), Eigen::Matrix2cd::Zero());
    if (std::all_of(gain.begin(), gain.end(), [](const auto& g) { return g.isZero(0.0); })) continue;
    for (int j = 0; j <= 2 * most; ++j) {
      const auto sum = coefficient<Eigen::Matrix2cd>(gain, j);
      c.back()[static_cast<std::size_t>(2 * most + j)] = sum;
      c.back()[static_cast<std::size_t>(2 * most - j)] = sum.conjugate();
    }
  }
  // Delays without force, of passes that no tooth meets, are left out.
  std::vector<std::size_t> used;
  for (std::size_t d = 0; d < delays.size(); ++d) {
    const auto& gain = forces.gain[1 + d];
    if (std::any_of(gain.begin(), gain.end(), [](const auto& g) { return !g.isZero(0.0); }))
      used.push_back(d);
  }
  MatrixXcd matrix = MatrixXcd::Identity(2 * n, 2 * n);
  VectorXcd right(2 * n);
  for (int r = -most; r <= most; ++r) {
    const auto g = receptance(modes_, r / period_);
    Eigen::Matrix2cd compliance;
    compliance << g[0], g[1], g[2], g[3];
    right.segment<2>(2 * (r + most)) = compliance * coefficient<Eigen::Vector2cd>(forces.force, r);
    for (int l = -most; l <= most; ++l) {
      const auto k = static_cast<std::size_t>(2 * most + r - l);
      Eigen::Matrix2cd sum = c[0][k];
      for (const std::size_t d : used)
        sum += std::polar(1.0, -TWO_PI * l * delays[d] / period_) * c[1 + d][k];
      matrix.block<2, 2>(2 * (r + most), 2 * (l + most)) -= compliance * sum;
    }
  }
  return linear::solve(matrix, right);
}

/// [m] The delayed forced vibration in the cells: [axis][cell].
std::vector<std::vector<double>> ForcedVibration::seriesAt(double delay, int most) const {
  std::vector<std::vector<double>> u(2, std::vector<double>(CELLS, 0.0));
  for (int r = 0; r <= most; ++r) {
    const Complex shift = std::polar(r == 0 ? 1.0 : 2.0, TWO_PI * r * (0.5 / CELLS - delay / period_));
    const Complex x = shift * spectrum_[2 * (r + most)], y = shift * spectrum_[2 * (r + most) + 1];
    for (int i = 0; i < CELLS; ++i) {
      const Complex wave = std::conj(rootOfUnity(static_cast<long>(r) * i));
      u[0][static_cast<std::size_t>(i)] += (x * wave).real();
      u[1][static_cast<std::size_t>(i)] += (y * wave).real();
    }
  }
  return u;
}

Eigen::Vector2d ForcedVibration::at(double turned) const {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  const Index most = (spectrum_.size() / 2 - 1) / 2;
  for (Index r = 0; !empty() && r <= most; ++r)
    sum += (std::polar(r == 0 ? 1.0 : 2.0, static_cast<double>(r) * turned) *
            spectrum_.segment<2>(2 * (r + most)))
               .real();
  return sum;
}

void ForcedVibration::update(const ContactForces& forces, const std::vector<double>& delays, double share) {
  double highest = 0.0;
  for (const SystemMode& mode : modes_) highest = std::max(highest, mode.frequency);
  const int most = std::min(CONTACT.most_harmonics, static_cast<int>(std::ceil(2.0 * highest * period_)) + 8);
  VectorXcd found = balance(forces, delays, most);
  if (!found.allFinite()) return;
  if (spectrum_.size() == found.size() && share < 1.0) found = share * found + (1.0 - share) * spectrum_;
  spectrum_ = found;
  motion_ = seriesAt(0.0, most);
  delayed_motion_.clear();
  for (const double delay : delays) delayed_motion_.push_back(seriesAt(delay, most));
}

}  // namespace smartmill::stability
