#include "kalman/expanded_disturbance.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/modal/state_space.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/filter/riccati.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;

constexpr std::size_t SHARE_OF_TRANSIENT = 4;  // the first quarter of a record is not scored

double rmseOf(const std::vector<double>& force, const std::vector<double>& truth, double sample_rate,
              double spindle_speed, int flutes, double band) {
  return scoreCut(force, truth, sample_rate, spindle_speed, flutes, truth.size() / SHARE_OF_TRANSIENT, band,
                  band)
      .rmse;
}

}  // namespace

ExpandedDisturbanceFilter::ExpandedDisturbanceFilter(const ModalModel& sensor, double sample_rate,
                                                     double tooth_passing, double q, double r)
    : sample_rate_(sample_rate) {
  const StateSpace modes = stateSpace(sensor);
  const Eigen::Index n = modes.a.rows(), all = n + 3;
  const double w = units::TWO_PI * tooth_passing;
  // States: modes, constant, oscillator x1 (the force) and w x2 (eq. 4-47).
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(all, all), noise = Eigen::MatrixXd::Zero(all, all);
  force_ = Eigen::RowVectorXd::Zero(all);
  force_(n) = force_(n + 1) = 1.0;
  a.topLeftCorner(n, n) = modes.a;
  a.topRows(n) += modes.b * force_;
  a(n + 1, n + 2) = -w;
  a(n + 2, n + 1) = w;
  Eigen::VectorXd drive = Eigen::VectorXd::Zero(all);
  drive(n) = drive(n + 1) = 1.0;
  noise = q * drive * drive.transpose();
  shown_ = modes.d(0, 0) * force_;
  shown_.head(n) += modes.c;
  const auto [phi, discrete] = discretiseNoise(a, noise, 1.0 / sample_rate);
  phi_ = phi;
  gain_ = stationaryGain(phi_, discrete, shown_, r).gain;
  state_ = Eigen::VectorXd::Zero(all);
}

double ExpandedDisturbanceFilter::step(double measured) {
  state_ = phi_ * state_;
  state_ += gain_ * (measured - shown_ * state_);
  return force_ * state_;
}

Complex ExpandedDisturbanceFilter::response(double f) const {
  const Eigen::Index n = phi_.rows();
  const Complex z = std::polar(1.0, units::TWO_PI * f / sample_rate_);
  const Eigen::MatrixXd closed = phi_ - gain_ * (shown_ * phi_);
  const Eigen::MatrixXcd left = Eigen::MatrixXcd::Identity(n, n) * z - closed.cast<Complex>();
  const Eigen::VectorXcd x = linear::solve(left, Eigen::VectorXcd(z * gain_.cast<Complex>()));
  return (force_.cast<Complex>() * x)(0);
}

std::vector<double> expandedDisturbanceForce(const std::vector<double>& measured, const ModalModel& sensor,
                                             double sample_rate, double tooth_passing, double q, double r) {
  ExpandedDisturbanceFilter filter(sensor, sample_rate, tooth_passing, q, r);
  std::vector<double> force;
  force.reserve(measured.size());
  for (const double sample : measured) force.push_back(filter.step(sample));
  return force;
}

// The filter is linear: its output for a tap is its FRF times the spectrum of the tap.
TuningMap expandedTapMap(const ReferenceTaps& taps, const ModalModel& sensor, double sample_rate, double r,
                         const std::vector<double>& speeds, int flutes, double band) {
  const auto lines = static_cast<std::size_t>(std::lround(sample_rate));  // 1 Hz apart
  std::vector<std::vector<Complex>> truth, shown;
  for (std::size_t tap = 0; tap < taps.hammer.size(); ++tap) {
    for (const auto& [record, spectra] :
         {std::pair{&taps.hammer[tap], &truth}, std::pair{&taps.response[tap], &shown}}) {
      std::vector<double> longer = *record;
      longer.resize(std::max(longer.size(), lines), 0.0);
      spectra->push_back(fourier(longer));
    }
  }
  TuningMap map;
  map.speed = speeds;
  for (int exponent = LEAST_EXPONENT; exponent <= MOST_EXPONENT; ++exponent) {
    map.rmse.emplace_back();
    for (const double speed : speeds) {
      const double turning = speed / units::TWO_PI;
      const ExpandedDisturbanceFilter filter(sensor, sample_rate, flutes * turning, std::pow(2.0, exponent),
                                             r);
      double squares = 0.0;
      std::size_t count = 0;
      for (double f = turning; f <= band; f += turning) {
        const auto line = static_cast<std::size_t>(std::lround(f));
        for (std::size_t k = line - 1; k <= line + 1; ++k) {
          const Complex passed = filter.response(static_cast<double>(k));
          for (std::size_t tap = 0; tap < truth.size(); ++tap, ++count)
            squares +=
                std::pow((std::abs(passed * shown[tap][k]) - std::abs(truth[tap][k])) / sample_rate, 2);
        }
      }
      map.rmse.back().push_back(std::sqrt(squares / static_cast<double>(std::max<std::size_t>(count, 1))));
    }
  }
  return map;
}

CutOptimum bestOfCut(const std::vector<double>& measured, const std::vector<double>& truth,
                     const ModalModel& sensor, double sample_rate, double spindle_speed, int flutes, double r,
                     double band) {
  CutOptimum best;
  best.rmse = std::numeric_limits<double>::infinity();
  for (int exponent = LEAST_EXPONENT; exponent <= MOST_EXPONENT; ++exponent) {
    const auto force = expandedDisturbanceForce(
        measured, sensor, sample_rate, flutes * spindle_speed / units::TWO_PI, std::pow(2.0, exponent), r);
    best.all.push_back(rmseOf(force, truth, sample_rate, spindle_speed, flutes, band));
    if (best.all.back() < best.rmse) best = {exponent, best.all.back(), best.all};
  }
  return best;
}

double kurtosis(const std::vector<double>& values) {
  const double middle = mean(values);
  double second = 0.0, fourth = 0.0;
  for (const double v : values) {
    const double square = (v - middle) * (v - middle);
    second += square;
    fourth += square * square;
  }
  const double n = static_cast<double>(values.size());
  return fourth / n / (second / n * second / n);
}

}  // namespace smartmill::kalman
