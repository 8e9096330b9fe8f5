#include "smartmill_kalman/filter/coupled_filter.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>

#include <Eigen/Core>
#include <Eigen/LU>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;
constexpr double LARGEST_CONDITION = 1e4;

Eigen::Matrix3cd matrixAt(const SensorMatrix& sensor, double f) {
  Eigen::Matrix3cd h;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) h(i, j) = sensor.h[i][j].response(f);
  }
  return h;
}

}  // namespace

std::array<std::array<Complex, 3>, 3> SensorMatrix::response(double f) const {
  std::array<std::array<Complex, 3>, 3> result;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) result[i][j] = h[i][j].response(f);
  }
  return result;
}

double SensorMatrix::condition(double f) const {
  const Eigen::Vector3d values = linear::singularValues(Eigen::MatrixXcd(matrixAt(*this, f)));
  return values(2) > 0.0 ? values(0) / values(2) : HUGE_VAL;
}

ModalModel fitCrossTalk(const FrequencyResponse& frf, const ModalModel& own, const ModalModel& other,
                        double low, double high) {
  ModalModel model;
  model.modes = own.modes;
  for (const Mode& mode : other.modes) {
    // A mode of both axes is taken once.
    const bool known = std::any_of(own.modes.begin(), own.modes.end(), [&](const Mode& m) {
      return std::abs(m.frequency / mode.frequency - 1.0) <
             0.5 * std::max(m.damping_ratio, mode.damping_ratio);
    });
    if (!known) model.modes.push_back(mode);
  }
  std::sort(model.modes.begin(), model.modes.end(),
            [](const Mode& a, const Mode& b) { return a.frequency < b.frequency; });
  const FrequencyResponse band = frf.band(low, high);
  const auto terms = static_cast<Eigen::Index>(model.modes.size() + 1);
  const auto lines = static_cast<Eigen::Index>(band.size());
  if (2 * lines < 2 * terms) throw Error("cross-talk: too few lines in the band");
  Eigen::MatrixXd a(2 * lines, terms);
  Eigen::VectorXd b(2 * lines);
  for (Eigen::Index l = 0; l < lines; ++l) {
    const auto k = static_cast<std::size_t>(l);
    const bool stated = k < band.std_dev.size() && band.std_dev[k] > 0.0 && std::isfinite(band.std_dev[k]);
    const double weight =
        stated ? std::sqrt(2.0) / band.std_dev[k] : 1.0;  // half of the variance on each part
    const auto set = [&](Eigen::Index column, Complex value) {
      a(2 * l, column) = weight * value.real();
      a(2 * l + 1, column) = weight * value.imag();
    };
    for (Eigen::Index t = 0; t + 1 < terms; ++t) {
      Mode unit = model.modes[static_cast<std::size_t>(t)];
      unit.gain = 1.0;
      set(t, unit.response(band.frequency[k]));
    }
    set(terms - 1, 1.0);
    b(2 * l) = weight * band.value[k].real();
    b(2 * l + 1) = weight * band.value[k].imag();
  }
  const Eigen::MatrixXd normal = a.transpose() * a;
  const Eigen::VectorXd x = linear::solveSymmetric(normal, Eigen::VectorXd(a.transpose() * b));
  const Eigen::MatrixXd covariance = linear::inverseSymmetric(normal);
  const double scale = std::max(
      1.0, (b - a * x).squaredNorm() / static_cast<double>(std::max<Eigen::Index>(1, 2 * lines - terms)));
  for (Eigen::Index t = 0; t + 1 < terms; ++t) {
    model.modes[static_cast<std::size_t>(t)].gain = x(t);
    model.modes[static_cast<std::size_t>(t)].gain_std = std::sqrt(scale * covariance(t, t));
  }
  model.direct = x(terms - 1);
  model.direct_std = std::sqrt(scale * covariance(terms - 1, terms - 1));
  return model;
}

CrossTalkInverse::CrossTalkInverse(const SensorMatrix& sensor, double spindle_speed, double sample_rate,
                                   int harmonics) {
  for (int n = 0; n <= harmonics; ++n) {
    const double f = n * spindle_speed / units::TWO_PI;
    if (!(sensor.condition(f) < LARGEST_CONDITION)) {
      throw Error("sensor matrix: cannot be inverted at " + std::to_string(f) + " Hz");
    }
    // Measured harmonics are the filters' own force times the axis' own response.
    const Eigen::Matrix3cd h = matrixAt(sensor, f);
    const Eigen::Matrix3cd change =
        h.inverse() * Eigen::Matrix3cd(h.diagonal().asDiagonal()) - Eigen::Matrix3cd::Identity();
    // The states of the filters are those of the next sample.
    const Complex back = std::polar(1.0, -n * spindle_speed / sample_rate);
    correction_.emplace_back();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) correction_.back()[i][j] = change(i, j) * back;
    }
  }
}

void CrossTalkInverse::add(const std::vector<HarmonicFilter>& axes, std::array<double, 3>& force) const {
  for (std::size_t n = 0; n < correction_.size(); ++n) {
    for (std::size_t j = 0; j < 3; ++j) {
      const Complex own = axes[j].pairs().forceHarmonic(n);
      for (std::size_t i = 0; i < 3; ++i) {
        const Complex& share = correction_[n][i][j];
        force[i] += share.real() * own.real() - share.imag() * own.imag();
      }
    }
  }
}

CoupledFilter::CoupledFilter(const SensorMatrix& sensor, double spindle_speed, double sample_rate,
                             const HarmonicFilterParameters& parameters) {
  for (std::size_t i = 0; i < 3; ++i)
    axis_.emplace_back(sensor.h[i][i], spindle_speed, sample_rate, parameters);
  inverse_.emplace_back(sensor, spindle_speed, sample_rate, axis_[0].pairs().harmonics());
}

std::array<double, 3> CoupledFilter::step(const std::array<double, 3>& measured) {
  std::array<double, 3> force{};
  for (std::size_t i = 0; i < 3; ++i) force[i] = axis_[i].step(measured[i]);
  inverse_.front().add(axis_, force);
  return force;
}

namespace {

constexpr const char* FORMAT = "smartmill-sensor-matrix/1";

std::string keyOf(std::size_t row, std::size_t column) {
  return std::string(AXIS_NAMES[row]) + AXIS_NAMES[column];
}

}  // namespace

SensorMatrix readSensorMatrix(const std::string& file) {
  const StrictYaml yaml = StrictYaml::fromFile(file);
  yaml.oneOf("format", {FORMAT});
  SensorMatrix matrix;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      const StrictYaml map = yaml.map(keyOf(i, j));
      ModalModel& model = matrix.h[i][j];
      model.direct = map.number("direct");
      if (map.has("modes")) {
        for (const StrictYaml& entry : map.maps("modes")) {
          Mode mode;
          mode.frequency = entry.number("frequency_hz", Range::positive());
          mode.damping_ratio = entry.number("damping_ratio", {0.0, 1.0, true, true});
          mode.gain = entry.number("gain");
          entry.finish();
          model.modes.push_back(mode);
        }
      }
      map.finish();
    }
  }
  yaml.finish();
  return matrix;
}

void writeSensorMatrix(const SensorMatrix& matrix, const std::string& file) {
  std::ofstream out(file);
  out << "format: " << FORMAT << "\n# first letter: measured axis, second: axis of the force\n";
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      const ModalModel& model = matrix.h[i][j];
      out << keyOf(i, j) << ":\n  direct: " << yamlNumber(model.direct, 17) << "\n";
      if (!model.modes.empty()) out << "  modes:\n";
      for (const Mode& mode : model.modes) {
        out << "  - {frequency_hz: " << yamlNumber(mode.frequency, 17)
            << ", damping_ratio: " << yamlNumber(mode.damping_ratio, 17)
            << ", gain: " << yamlNumber(mode.gain, 17) << "}\n";
      }
    }
  }
  out.close();
  if (!out) throw Error(file + ": cannot write");
}

}  // namespace smartmill::kalman
