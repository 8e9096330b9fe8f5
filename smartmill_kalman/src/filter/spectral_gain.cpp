// Spectral factorisation of a filter of harmonics through a sensor's modes.
//
// Decoupled coordinates, each multiplied by exp(s dt) per sample: the free response m of a mode and its
// conjugate, w_n = F_n - i G_n of a harmonic and its conjugate, and the constant. White noise on F and G is
// circular noise on w_n; it excites the free response of a mode through the steady-state response. B_ij is
// the noise's intensity between two coordinates; a step's covariance is B_ij (exp((s_i + s_j*) dt) - 1) /
// (s_i + s_j*).

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <vector>

#include "smartmill_core/units.h"
#include "smartmill_kalman/filter/harmonic_gain.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;
using Vector = std::vector<Complex>;

constexpr int MAX_SWEEPS = 60;
constexpr double ROOT_TOLERANCE = 1e-9;    // [1] step of a root at convergence (cubic)
constexpr double TOLERANCE = 1e-9;         // [1] of the factors' product over the spectrum
constexpr double MIN_TRANSMISSION = 1e-6;  // [1] least transmissibility for a numerically valid covariance

// Division without checks for infinities, which do not occur here.
Complex reciprocal(Complex z) {
  const double scale = 1.0 / (z.real() * z.real() + z.imag() * z.imag());
  return {z.real() * scale, -z.imag() * scale};
}

Complex times(Complex a, Complex b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

/// Model in decoupled coordinates: modes, constant, harmonics; one of each conjugate pair.
class DecoupledModel {
 public:
  explicit DecoupledModel(const HarmonicDesign& design)
      : modes_(design.sensor.modes.size()), count_(modes_ + design.settling.size()) {
    const double dt = 1.0 / design.sample_rate, r = design.noise_rms * design.noise_rms;
    for (const Mode& mode : design.sensor.modes) {
      const double wn = units::TWO_PI * mode.frequency;
      const double wd = wn * std::sqrt(1.0 - mode.damping_ratio * mode.damping_ratio);
      s_.emplace_back(-mode.damping_ratio * wn, wd);
      c_.emplace_back(0.5);
      drive_.emplace_back(0.0, -mode.gain * wn * wn / wd);
    }
    for (std::size_t n = 0; n < design.settling.size(); ++n) {
      const double w = static_cast<double>(n) * design.spindle_speed;
      s_.emplace_back(0.0, w);
      c_.push_back((n == 0 ? 1.0 : 0.5) * design.sensor.response(w / units::TWO_PI));
      // Of the circular noise of a pair: both its parts.
      intensity_.push_back((n == 0 ? 1.0 : 2.0) * r * dt / (design.settling[n] * design.settling[n]));
    }
    c_[modes_] = c_[modes_].real();
    for (const Complex s : s_) turn_.push_back(std::exp(s * dt));
  }

  std::size_t modes() const { return modes_; }
  std::size_t count() const { return count_; }
  bool single(std::size_t i) const { return i == modes_; }  ///< the constant is its own conjugate
  Complex turn(std::size_t i) const { return turn_[i]; }
  Complex output(std::size_t i) const { return c_[i]; }
  double intensity(std::size_t n) const { return intensity_[n]; }

  /// Contribution of harmonic n's noise, and of its conjugate, to the free response of mode k.
  std::array<Complex, 2> shares(std::size_t k, std::size_t n) const {
    const Complex w = s_[modes_ + n];
    if (n == 0) return {drive_[k] / s_[k], 0.0};
    return {-0.5 * drive_[k] / (w - s_[k]), -0.5 * drive_[k] / (std::conj(w) - s_[k])};
  }

  /// -B_ij / (s_i + s_j*), the covariance without measurements; i a mode or a harmonic, j a mode. @param
  /// conjugate of j
  Complex between(std::size_t i, std::size_t j, bool conjugate) const {
    const Complex sum = s_[i] + (conjugate ? s_[j] : std::conj(s_[j]));
    Complex b = 0.0;
    if (i >= modes_) {
      const auto share = shares(j, i - modes_);
      b = intensity_[i - modes_] * (conjugate ? share[1] : std::conj(share[0]));
      if (single(i) && conjugate) b = intensity_[0] * share[0];
    } else {
      for (std::size_t n = 0; n < intensity_.size(); ++n) {
        const auto a = shares(i, n), c = shares(j, n);
        const Complex one = conjugate ? c[1] : std::conj(c[0]), other = conjugate ? c[0] : std::conj(c[1]);
        b += intensity_[n] *
             (n == 0 ? a[0] * (conjugate ? c[0] : std::conj(c[0])) : a[0] * one + a[1] * other);
      }
    }
    return -b / sum;
  }

 private:
  std::size_t modes_, count_;
  Vector s_, c_, drive_, turn_;
  std::vector<double> intensity_;
};

/// The spectrum r + sum h a + h* (b - 1) + e a b with a = 1 / (1 - pole / z), b = 1 / (1 - pole* z), over all
/// poles and their conjugates, and what its logarithm rises over log z.
class Spectrum {
 public:
  Spectrum(const DecoupledModel& plant, double r, double dt) : r_(r) {
    for (std::size_t i = 0; i < plant.count(); ++i) {
      pole_.push_back(plant.turn(i));
      Complex h = 0.0;
      double e = 0.0;
      if (i >= plant.modes()) {
        e = std::norm(plant.output(i)) * plant.intensity(i - plant.modes()) * dt;
        for (std::size_t k = 0; k < plant.modes(); ++k)
          h += 0.5 * plant.output(i) * (plant.between(i, k, false) + plant.between(i, k, true));
      } else {
        for (std::size_t k = 0; k < plant.modes(); ++k)
          h += 0.25 * (plant.between(i, k, false) + plant.between(i, k, true));
        for (std::size_t n = plant.modes(); n < plant.count(); ++n) {
          h += 0.5 * std::conj(plant.output(n)) * std::conj(plant.between(n, i, false));
          if (!plant.single(n)) h += 0.5 * plant.output(n) * plant.between(n, i, true);
        }
      }
      h_.push_back(h);
      e_.push_back(e);
    }
    single_ = plant.modes();
  }

  struct Value {
    Complex spectrum, poles;  ///< [N2], sum of a - b: rise of the logarithm of the poles' product
    Complex rise;             ///< [N2] of the spectrum
  };
  Value at(Complex z) const {
    Value value{r_, 0.0, 0.0};
    const Complex inverse = reciprocal(z);
    for (std::size_t i = 0; i < pole_.size(); ++i) {
      add(value, pole_[i], h_[i], e_[i], z, inverse);
      if (i != single_) add(value, std::conj(pole_[i]), std::conj(h_[i]), e_[i], z, inverse);
    }
    return value;
  }

 private:
  static void add(Value& value, Complex pole, Complex h, double e, Complex z, Complex inverse) {
    const Complex a = reciprocal(1.0 - times(pole, inverse)), b = reciprocal(1.0 - times(std::conj(pole), z));
    const Complex ab = times(a, b);
    value.spectrum += times(h, a) + times(std::conj(h), b - 1.0) + e * ab;
    value.rise += times(h, a - times(a, a)) + times(std::conj(h), times(b, b) - b) + e * times(ab, b - a);
    value.poles += a - b;
  }

  double r_;
  Vector pole_, h_;
  std::vector<double> e_;
  std::size_t single_ = 0;
};

/// Zeros of the spectrum inside the unit circle, one of each conjugate pair, the real one in the place of the
/// constant. @return empty when they are not found
Vector zeros(const Spectrum& spectrum, Vector zero, std::size_t single) {
  std::vector<bool> found(zero.size(), false);
  std::size_t left = zero.size();
  for (int sweep = 0; sweep < MAX_SWEEPS && left > 0; ++sweep) {
    for (std::size_t i = 0; i < zero.size(); ++i) {
      if (found[i]) continue;
      const Complex z = zero[i], inverse = reciprocal(z);
      const Spectrum::Value value = spectrum.at(z);
      Complex own = value.rise / value.spectrum + value.poles;
      for (std::size_t j = 0; j < zero.size(); ++j) {
        if (j != i) own -= reciprocal(1.0 - times(zero[j], inverse));
        own += reciprocal(1.0 - times(std::conj(zero[j]), z));
        if (j == single) continue;
        own -= reciprocal(1.0 - times(std::conj(zero[j]), inverse));
        own += reciprocal(1.0 - times(zero[j], z));
      }
      Complex step = reciprocal(own);
      if (i == single) step = step.real();
      if (!std::isfinite(std::abs(step))) return {};
      Complex next = z * (1.0 - step);
      // A root outside the circle is the reciprocal of one inside.
      if (std::abs(next) >= 1.0) next = 1.0 / std::conj(next);
      found[i] = std::abs(next - z) <= ROOT_TOLERANCE;
      left -= found[i] ? 1 : 0;
      zero[i] = next;
    }
  }
  return left == 0 ? zero : Vector{};
}

/// Initial zeros: each harmonic damped as in a comb filter, sinh(decay T / 2) = |H| T / (2 tau).
Vector firstZeros(const DecoupledModel& plant, const HarmonicDesign& design) {
  const double dt = 1.0 / design.sample_rate, revolution = units::TWO_PI / design.spindle_speed;
  Vector zero;
  for (std::size_t i = 0; i < plant.count(); ++i) {
    if (i < plant.modes()) {
      zero.push_back(plant.turn(i) * std::abs(plant.turn(i)));
      continue;
    }
    const double passed = std::abs(plant.output(i)) * (plant.single(i) ? 1.0 : 2.0);
    const double tau = design.settling[i - plant.modes()];
    const double decay = 2.0 / revolution * std::asinh(passed * revolution / (2.0 * tau));
    zero.push_back(plant.turn(i) * std::exp(-decay * dt));
  }
  return zero;
}

/// Gain, innovation variance and covariance from the zeros.
class SpectralFactor {
 public:
  SpectralFactor(const DecoupledModel& plant, const Spectrum& spectrum, Vector zero)
      : plant_(plant), zero_(std::move(zero)) {
    // Check between the poles around the circle: the product of the factors is the spectrum.
    const std::size_t points = 2 * zero_.size() + 1;
    for (std::size_t i = 0; i < points; ++i) {
      const Complex z =
          std::polar(1.0, units::PI * (static_cast<double>(i) + 0.5) / static_cast<double>(points));
      const double ratio = spectrum.at(z).spectrum.real() / std::norm(whitened(z));
      if (i == 0) variance_ = ratio;
      misfit_ = std::max(misfit_, std::abs(ratio / variance_ - 1.0));
    }
    for (std::size_t i = 0; i < plant.count(); ++i) predictor_.push_back(residue(i) / plant.output(i));
  }

  double variance() const { return variance_; }
  double misfit() const { return misfit_; }
  Complex filter(std::size_t i) const { return predictor_[i] / plant_.turn(i); }

  /// P d' of coordinate i, d = 1/2 for each harmonic and its conjugate, 1 for the constant.
  Complex smoothing(std::size_t i) const {
    const std::size_t first = plant_.modes();
    Complex sum = 0.0, rest = variance_ * filter(i);
    for (std::size_t j = 0; j < plant_.count(); ++j) {
      for (const bool conjugate : {false, true}) {
        if ((conjugate && plant_.single(j)) || (i == j && !conjugate && i >= first)) continue;
        const Complex p = covariance(i, j, conjugate);
        rest -= p * (conjugate ? plant_.output(j) : std::conj(plant_.output(j)));
        if (j >= first) sum += (plant_.single(j) ? 1.0 : 0.5) * p;
      }
    }
    // The rest of P c' belongs to the harmonic itself.
    if (i >= first) sum += (plant_.single(i) ? 1.0 : 0.5) * rest / std::conj(plant_.output(i));
    return sum;
  }

 private:
  /// Product of 1 - zero / z over 1 - pole / z.
  Complex whitened(Complex z) const {
    Complex product = 1.0;
    for (std::size_t j = 0; j < zero_.size(); ++j) {
      product *= (z - zero_[j]) / (z - plant_.turn(j));
      if (!plant_.single(j)) product *= (z - std::conj(zero_[j])) / (z - std::conj(plant_.turn(j)));
    }
    return product;
  }

  Complex residue(std::size_t i) const {
    const Complex pole = plant_.turn(i);
    Complex product = 1.0;
    for (std::size_t j = 0; j < zero_.size(); ++j) {
      product *= j == i ? pole - zero_[j] : (pole - zero_[j]) / (pole - plant_.turn(j));
      if (plant_.single(j)) continue;
      product *= (pole - std::conj(zero_[j])) / (pole - std::conj(plant_.turn(j)));
    }
    return product;
  }

  /// Between coordinate i and coordinate j or its conjugate; not of a harmonic with itself.
  Complex covariance(std::size_t i, std::size_t j, bool conjugate) const {
    const Complex turned = plant_.turn(i) * (conjugate ? plant_.turn(j) : std::conj(plant_.turn(j)));
    const Complex gains = predictor_[i] * (conjugate ? predictor_[j] : std::conj(predictor_[j]));
    Complex unseen = 0.0;
    if (j < plant_.modes()) {
      unseen = plant_.between(i, j, conjugate);
    } else if (i < plant_.modes()) {
      unseen = conjugate ? plant_.between(j, i, true) : std::conj(plant_.between(j, i, false));
    }
    return unseen - variance_ * gains / (1.0 - turned);
  }

  const DecoupledModel& plant_;
  Vector zero_, predictor_;
  double variance_ = 0.0, misfit_ = 0.0;
};

/// A vector of uncoupled coordinates in those of HarmonicGain.
std::vector<double> stateOf(const Vector& v, const HarmonicDesign& design) {
  const std::size_t modes = design.sensor.modes.size();
  std::vector<double> state;
  for (std::size_t k = 0; k < modes; ++k) {
    const Mode& mode = design.sensor.modes[k];
    const double wn = units::TWO_PI * mode.frequency, zeta = mode.damping_ratio;
    const double wd = wn * std::sqrt(1.0 - zeta * zeta);
    double x1 = (zeta * wn * v[k].real() - wd * v[k].imag()) / wn, x2 = v[k].real();
    for (std::size_t n = 0; n < design.settling.size(); ++n) {
      const double w = static_cast<double>(n) * design.spindle_speed;
      const Complex second = mode.response(w / units::TWO_PI) * v[modes + n];
      x1 += (Complex(2.0 * zeta * wn, w) / wn * second).real();
      x2 += second.real();
    }
    state.insert(state.end(), {x1, x2});
  }
  state.push_back(v[modes].real());
  for (std::size_t i = modes + 1; i < v.size(); ++i) state.insert(state.end(), {v[i].real(), -v[i].imag()});
  return state;
}

}  // namespace

std::optional<HarmonicGain> spectralGain(const HarmonicDesign& design) {
  const DecoupledModel plant(design);
  for (std::size_t i = plant.modes(); i < plant.count(); ++i) {
    if (std::abs(plant.output(i)) < MIN_TRANSMISSION) return std::nullopt;
  }
  const Spectrum spectrum(plant, design.noise_rms * design.noise_rms, 1.0 / design.sample_rate);
  Vector zero = zeros(spectrum, firstZeros(plant, design), plant.modes());
  if (zero.empty()) return std::nullopt;
  const SpectralFactor factor(plant, spectrum, std::move(zero));
  if (!(factor.misfit() < TOLERANCE)) return std::nullopt;
  Vector filter, smoothing;
  for (std::size_t i = 0; i < plant.count(); ++i) {
    filter.push_back(factor.filter(i));
    smoothing.push_back(factor.smoothing(i));
  }
  return HarmonicGain{stateOf(filter, design), stateOf(smoothing, design), factor.variance()};
}

}  // namespace smartmill::kalman
