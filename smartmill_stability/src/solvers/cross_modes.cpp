#include "smartmill_stability/solvers/cross_modes.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include <Eigen/Core>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr double LEAST = 1e-9;  // [1] least gain over the mean gain

struct Pair {
  std::size_t x, y;
  double frequency, damping_ratio;  // means of both fits
};

/// Pairs each mode of x with the nearest of y, if their half-power bands overlap.
std::vector<Pair> pairsOf(const ModalModel& x, const ModalModel& y) {
  std::vector<Pair> pairs;
  std::vector<bool> taken(y.modes.size(), false);
  for (std::size_t i = 0; i < x.modes.size(); ++i) {
    const Mode& a = x.modes[i];
    std::size_t best = y.modes.size();
    double least = 1.0;
    for (std::size_t j = 0; j < y.modes.size(); ++j) {
      const Mode& b = y.modes[j];
      const double distance = std::abs(a.frequency - b.frequency) /
                              (a.damping_ratio * a.frequency + b.damping_ratio * b.frequency);
      if (taken[j] || distance >= least || !(a.gain > 0.0) || !(b.gain > 0.0)) continue;
      least = distance;
      best = j;
    }
    if (best == y.modes.size()) continue;
    taken[best] = true;
    const Mode& b = y.modes[best];
    // The fit with the larger gain of the mode is more accurate.
    const double share = a.gain / (a.gain + b.gain);
    pairs.push_back({i, best, share * a.frequency + (1.0 - share) * b.frequency,
                     share * a.damping_ratio + (1.0 - share) * b.damping_ratio});
  }
  return pairs;
}

/// [m/N] Residues of the cross receptance as static gains; 0 where they are not significant.
std::vector<double> residues(const std::vector<Pair>& pairs, const FrequencyResponse& cross) {
  const auto lines = static_cast<Eigen::Index>(cross.size()), count = static_cast<Eigen::Index>(pairs.size());
  if (lines <= count || count == 0) return std::vector<double>(pairs.size(), 0.0);
  Eigen::MatrixXd a(2 * lines, count);
  Eigen::VectorXd b(2 * lines);
  for (Eigen::Index l = 0; l < lines; ++l) {
    const auto i = static_cast<std::size_t>(l);
    for (Eigen::Index k = 0; k < count; ++k) {
      const Pair& pair = pairs[static_cast<std::size_t>(k)];
      const double r = cross.frequency[i] / pair.frequency;
      const std::complex<double> h = 1.0 / std::complex<double>(1.0 - r * r, 2.0 * pair.damping_ratio * r);
      a(2 * l, k) = h.real();
      a(2 * l + 1, k) = h.imag();
    }
    b[2 * l] = cross.value[i].real();
    b[2 * l + 1] = cross.value[i].imag();
  }
  const Eigen::MatrixXd normal = a.transpose() * a;
  const Eigen::MatrixXd inverse = linear::inverseSymmetric(normal);
  const Eigen::VectorXd found = inverse * (a.transpose() * b);
  const double variance = (a * found - b).squaredNorm() / static_cast<double>(2 * lines - count);
  std::vector<double> values;
  for (Eigen::Index k = 0; k < count; ++k)
    values.push_back(std::abs(found[k]) > 2.0 * std::sqrt(variance * inverse(k, k)) ? found[k] : 0.0);
  return values;
}

/// Index of a mode within systemModes(), which omits modes with zero gain.
std::size_t systemIndex(const ModalModel& model, std::size_t mode) {
  return static_cast<std::size_t>(std::count_if(model.modes.begin(),
                                                model.modes.begin() + static_cast<std::ptrdiff_t>(mode),
                                                [](const Mode& m) { return m.gain != 0.0; }));
}

}  // namespace

std::vector<SystemMode> crossModes(const ModalModel& x, const ModalModel& y, const FrequencyResponse& cross) {
  const std::vector<Pair> pairs = pairsOf(x, y);
  const std::vector<double> residue = residues(pairs, cross);
  std::vector<SystemMode> modes = systemModes(x, y);
  const std::size_t in_x = systemModes(x, 0).size();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (residue[k] == 0.0) continue;
    const Pair& pair = pairs[k];
    const double xx = x.modes[pair.x].gain, yy = y.modes[pair.y].gain, most = std::sqrt(xx * yy);
    const double xy = std::clamp(residue[k], -most, most);
    // Principal directions of [[xx, xy], [xy, yy]].
    const double rotation = 0.5 * std::atan2(2.0 * xy, xx - yy), middle = 0.5 * (xx + yy),
                 half = std::hypot(0.5 * (xx - yy), xy);
    const bool strong_in_x = std::abs(std::cos(rotation)) > std::sqrt(0.5);
    for (const bool strong : {true, false}) {
      // A pair that is a single mode has no gain across it; the second mode remains to preserve the order.
      const double gain = std::max(strong ? middle + half : middle - half, LEAST * middle);
      const double size = units::TWO_PI * pair.frequency * std::sqrt(gain);
      const double angle = strong ? rotation : rotation + 0.5 * units::PI;
      SystemMode& mode =
          modes[strong == strong_in_x ? systemIndex(x, pair.x) : in_x + systemIndex(y, pair.y)];
      mode.frequency = pair.frequency;
      mode.damping_ratio = pair.damping_ratio;
      mode.input = mode.output = {{size * std::cos(angle), size * std::sin(angle)}};
    }
  }
  return modes;
}

}  // namespace smartmill::stability
