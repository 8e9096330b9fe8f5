#include "smartmill_core/modal/modal_poles.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::VectorXcd;

/// Angle of z over the lines; the remaining angle is left for computational poles.
constexpr double TURN = 0.95 * units::PI;
/// Sums over the lines of one FRF, from which the normal equations of every order are built.
struct LineSums {
  VectorXcd plain, mixed, mixed_back, power;  // sum w z^m, -w h z^m, -w h z^-m, w |h|^2 z^m
};

LineSums sumsOf(const WeightedLines& lines, std::size_t frf, const PoleSearch& search) {
  const Index size = search.largest_order + 1;
  const double f0 = lines.frequency[search.first], turn = TURN / (lines.frequency[search.last - 1] - f0);
  LineSums sums{VectorXcd::Zero(size), VectorXcd::Zero(size), VectorXcd::Zero(size), VectorXcd::Zero(size)};
  double scale = 0.0;
  for (std::size_t i = search.first; i < search.last; ++i)
    scale += std::norm(lines.value[frf][i] * lines.weight[frf][i]);
  if (!(scale > 0.0)) return sums;
  for (std::size_t i = search.first; i < search.last; ++i) {
    const Complex h = lines.value[frf][i], z = std::polar(1.0, turn * (lines.frequency[i] - f0));
    const double w = lines.weight[frf][i] * lines.weight[frf][i] / scale;
    const double power = w * std::norm(h);
    Complex along = 1.0;
    for (Index m = 0; m < size; ++m) {
      sums.plain[m] += w * along;
      sums.mixed[m] -= w * h * along;
      sums.mixed_back[m] -= w * h * std::conj(along);
      sums.power[m] += power * along;
      along *= z;
    }
  }
  return sums;
}

/// Entry (k, l): forward[l - k], below the diagonal backward[k - l].
MatrixXcd toeplitz(const VectorXcd& forward, const VectorXcd& backward, Index size) {
  MatrixXcd t(size, size);
  for (Index k = 0; k < size; ++k) {
    for (Index l = 0; l < size; ++l) t(k, l) = l >= k ? forward[l - k] : backward[k - l];
  }
  return t;
}

/// Roots of sum a_r z^r by the companion matrix.
VectorXcd roots(const VectorXcd& a) {
  const Index n = a.size() - 1;
  MatrixXcd companion = MatrixXcd::Zero(n, n);
  for (Index k = 0; k + 1 < n; ++k) companion(k + 1, k) = 1.0;
  for (Index k = 0; k < n; ++k) companion(k, n - 1) = -a[k] / a[n];
  return linear::eigenvalues(companion);
}

VectorXcd denominator(const std::vector<LineSums>& sums, int order) {
  const Index n = order + 1;
  MatrixXcd m = MatrixXcd::Zero(n, n);
  for (const LineSums& s : sums) {
    const MatrixXcd mixed = toeplitz(s.mixed, s.mixed_back, n);
    MatrixXcd plain = toeplitz(s.plain, s.plain.conjugate(), n);
    plain.diagonal().array() += 1e-14 * std::abs(plain(0, 0));
    m += toeplitz(s.power, s.power.conjugate(), n) - mixed.adjoint() * linear::solveSymmetric(plain, mixed);
  }
  VectorXcd a(n);
  a[0] = 1.0;
  a.tail(n - 1) =
      linear::solve(MatrixXcd(m.bottomRightCorner(n - 1, n - 1)), VectorXcd(-m.col(0).tail(n - 1)));
  return a;
}

bool isSamePole(const Pole& a, const Pole& b, const PoleSearch& search) {
  return std::abs(a.frequency - b.frequency) < search.stable_frequency * b.frequency &&
         std::abs(a.damping_ratio - b.damping_ratio) < search.stable_damping * b.damping_ratio + 2e-5;
}

/// One pole through the orders.
struct Track {
  std::vector<Pole> poles;

  double distance(const Pole& p, double same_frequency) const {
    const Pole& last = poles.back();
    const double width = std::max(same_frequency * last.frequency, 0.5 * last.halfWidth());
    return std::hypot((p.frequency - last.frequency) / width,
                      (p.damping_ratio - last.damping_ratio) / (0.4 * last.damping_ratio + 3e-5));
  }
  /// Medians over the upper half of the orders.
  Pole middle() const {
    std::vector<double> frequency, damping;
    for (std::size_t k = poles.size() / 2; k < poles.size(); ++k) {
      frequency.push_back(poles[k].frequency);
      damping.push_back(poles[k].damping_ratio);
    }
    return {static_cast<int>(poles.size()), median(frequency), median(damping), true};
  }
};

void follow(std::vector<Track>& tracks, const std::vector<Pole>& now, double same_frequency) {
  std::vector<bool> used(now.size(), false);
  for (Track& track : tracks) {
    double nearest = 1.0;
    std::size_t at = now.size();
    for (std::size_t k = 0; k < now.size(); ++k) {
      const double far = track.distance(now[k], same_frequency);
      if (!used[k] && far < nearest) nearest = far, at = k;
    }
    if (at == now.size()) continue;
    used[at] = true;
    track.poles.push_back(now[at]);
  }
  for (std::size_t k = 0; k < now.size(); ++k) {
    if (!used[k]) tracks.push_back({{now[k]}});
  }
}

}  // namespace

std::vector<Pole> polesByOrder(const WeightedLines& lines, const PoleSearch& search) {
  std::vector<LineSums> sums;
  for (std::size_t o = 0; o < lines.frfs(); ++o) sums.push_back(sumsOf(lines, o, search));
  const double low = lines.frequency[search.first], high = lines.frequency[search.last - 1];
  const double turn = TURN / (high - low);
  std::vector<Pole> poles, before;
  for (int order = 2; order <= search.largest_order; order += search.order_step) {
    std::vector<Pole> now;
    const VectorXcd a = denominator(sums, order);
    if (!a.allFinite()) break;
    for (const Complex& z : roots(a)) {
      const Complex logarithm = std::log(z);
      double angle = logarithm.imag();
      if (angle < -0.5 * (units::TWO_PI - TURN)) angle += units::TWO_PI;
      const Complex pole(logarithm.real() / turn, low + angle / turn);  // [Hz]
      if (!(pole.real() < 0.0) || !(pole.imag() > low && pole.imag() < high)) continue;
      const double frequency = std::abs(pole);
      Pole p{order, frequency, -pole.real() / frequency, false};
      p.stable =
          std::any_of(before.begin(), before.end(), [&](const Pole& b) { return isSamePole(p, b, search); });
      now.push_back(p);
    }
    poles.insert(poles.end(), now.begin(), now.end());
    before = std::move(now);
  }
  return poles;
}

std::vector<Pole> persistentPoles(const std::vector<Pole>& poles, const PoleSearch& search) {
  std::vector<Track> tracks;
  std::size_t i = 0;
  for (int order = 2; order <= search.largest_order; order += search.order_step) {
    std::vector<Pole> now;
    for (; i < poles.size() && poles[i].order == order; ++i) now.push_back(poles[i]);
    follow(tracks, now, search.same_frequency);
  }
  std::stable_sort(tracks.begin(), tracks.end(),
                   [](const Track& a, const Track& b) { return a.poles.size() > b.poles.size(); });
  std::vector<Pole> found;
  for (const Track& track : tracks) {
    if (track.poles.size() < search.least_orders) break;
    const Pole p = track.middle();
    const bool known = std::any_of(found.begin(), found.end(), [&](const Pole& q) {
      return std::abs(q.frequency - p.frequency) < 0.3 * q.halfWidth() + 1e-5 * q.frequency;
    });
    if (!known) found.push_back(p);
  }
  return found;
}

}  // namespace smartmill
