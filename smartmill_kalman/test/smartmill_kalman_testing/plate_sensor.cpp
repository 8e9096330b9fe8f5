#include "smartmill_kalman_testing/plate_sensor.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include <Eigen/LU>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

Eigen::Matrix3d cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v(2), v(1), v(2), 0.0, -v(0), -v(1), v(0), 0.0;
  return m;
}

struct Plate {
  Matrix6 mass = Matrix6::Zero(), stiffness = Matrix6::Zero(), damping = Matrix6::Zero();

  explicit Plate(const PlateSensor& p) {
    const Eigen::Vector3d c(p.centre[0], p.centre[1], p.centre[2]);
    Eigen::Vector3d inertia;
    for (int i = 0; i < 3; ++i) {
      const double a = p.size[(i + 1) % 3], b = p.size[(i + 2) % 3];
      inertia(i) = p.mass * (a * a + b * b) / 12.0;
    }
    mass.topLeftCorner<3, 3>() = p.mass * Eigen::Matrix3d::Identity();
    mass.topRightCorner<3, 3>() = -p.mass * cross(c);
    mass.bottomLeftCorner<3, 3>() = p.mass * cross(c);
    mass.bottomRightCorner<3, 3>() = Eigen::Matrix3d(inertia.asDiagonal()) - p.mass * cross(c) * cross(c);
    Eigen::Vector3d k, d;
    for (int i = 0; i < 3; ++i) {
      const double w = units::TWO_PI * p.frequency[i];
      k(i) = p.mass * w * w / 4.0;
      d(i) = 2.0 * p.damping * p.mass * w / 4.0;
    }
    for (const double x : {-p.foot, p.foot}) {
      for (const double y : {-p.foot, p.foot}) {
        // A foot at r moves by u + rotation x r and pushes back; its force turns about the origin.
        Eigen::Matrix<double, 3, 6> move;
        move << Eigen::Matrix3d::Identity(), -cross(Eigen::Vector3d(x, y, 0.0));
        stiffness += move.transpose() * k.asDiagonal() * move;
        damping += move.transpose() * d.asDiagonal() * move;
      }
    }
  }

  Eigen::Matrix<Complex, 6, 6> response(double f) const {
    const double w = units::TWO_PI * f;
    const Eigen::Matrix<Complex, 6, 6> feet = stiffness.cast<Complex>() + Complex(0.0, w) * damping;
    const Eigen::Matrix<Complex, 6, 6> all = feet - w * w * mass.cast<Complex>();
    return feet * all.inverse();
  }
};

}  // namespace

Eigen::MatrixXcd PlateSensor::response(double f) const {
  return Plate(*this).response(f);
}

std::vector<std::vector<double>> PlateSensor::measure(const std::array<std::vector<double>, 3>& force,
                                                      const std::array<double, 3>& point, double sample_rate,
                                                      std::size_t channels, std::mt19937& random) const {
  const Plate plate(*this);
  const std::size_t samples = force[0].size(),
                    length = 2 * samples;  // zero padding for the decaying response
  const std::vector<double> line = fourierFrequencies(length, sample_rate);
  std::array<std::vector<Complex>, 3> applied;
  for (std::size_t i = 0; i < 3; ++i) {
    std::vector<double> padded = force[i];
    padded.resize(length, 0.0);
    applied[i] = fourier(padded);
  }
  std::vector<std::vector<Complex>> spectra(6, std::vector<Complex>(line.size()));
  const Eigen::Vector3d r(point[0], point[1], point[2]);
  for (std::size_t l = 0; l < line.size(); ++l) {
    const Eigen::Vector3cd f(applied[0][l], applied[1][l], applied[2][l]);
    Eigen::Matrix<Complex, 6, 1> wrench;
    wrench << f, cross(r).cast<Complex>() * f;
    const Eigen::Matrix<Complex, 6, 1> feet = plate.response(line[l]) * wrench;
    for (Eigen::Index c = 0; c < 6; ++c) spectra[static_cast<std::size_t>(c)][l] = feet(c);
  }
  std::normal_distribution<double> normal(0.0, 1.0);
  std::vector<std::vector<double>> records;
  for (std::size_t c = 0; c < channels; ++c) {
    // The highest line of a real signal is real.
    if (length % 2 == 0) spectra[c].back() = spectra[c].back().real();
    records.push_back(inverseFourier(spectra[c], length));
    records.back().resize(samples);
    for (double& v : records.back()) v += (c < 3 ? force_noise : moment_noise) * normal(random);
  }
  return records;
}

std::vector<MatrixTap> tapPlate(const PlateSensor& plate, double sample_rate, std::size_t channels, int hits,
                                std::mt19937& random) {
  constexpr double CONTACT = 1.1e-4, PEAK = 300.0, BEFORE = 5e-3, LENGTH = 0.05, NOISE = 0.02;
  constexpr double TOP = 0.03;
  std::vector<std::array<std::array<double, 3>, 2>> points;  // where, along what
  for (const double x : {-0.03, 0.0, 0.03}) {
    for (const double y : {-0.025, 0.025}) points.push_back({{{x, y, TOP}, {0.0, 0.0, -1.0}}});
  }
  for (const double y : {-0.02, 0.02}) {
    for (const double z : {0.012, 0.028}) points.push_back({{{0.045, y, z}, {-1.0, 0.0, 0.0}}});
  }
  for (const double x : {-0.02, 0.02}) {
    for (const double z : {0.012, 0.028}) points.push_back({{{x, -0.04, z}, {0.0, 1.0, 0.0}}});
  }
  std::normal_distribution<double> normal(0.0, 1.0);
  std::vector<MatrixTap> taps;
  for (const auto& [point, direction] : points) {
    for (int h = 0; h < hits; ++h) {
      MatrixTap tap;
      tap.point = point;
      tap.direction = direction;
      std::array<std::vector<double>, 3> force;
      for (int i = 0; i < static_cast<int>(LENGTH * sample_rate); ++i) {
        const double t = i / sample_rate - BEFORE;
        const double hit =
            t > 0.0 && t < CONTACT ? PEAK * std::pow(std::sin(units::PI * t / CONTACT), 2) : 0.0;
        tap.hammer.push_back(hit + NOISE * normal(random));
        for (std::size_t axis = 0; axis < 3; ++axis) force[axis].push_back(hit * direction[axis]);
      }
      tap.channels = plate.measure(force, point, sample_rate, channels, random);
      taps.push_back(std::move(tap));
    }
  }
  return taps;
}

std::vector<double> bouncingContact(double sample_rate, double duration, double start) {
  constexpr double MASS = 0.05, PUSH = 40.0, SPEED = 0.35, STIFFNESS = 1.2e7, DAMPING = 90.0;  // SI
  constexpr int FINER = 64;
  const double dt = 1.0 / sample_rate / FINER;
  double gap = SPEED * start, speed = -SPEED;  // [m], [m/s]; it flies free until start
  std::vector<double> force;
  for (int i = 0; i < static_cast<int>(duration * sample_rate); ++i) {
    double contact = 0.0;
    for (int k = 0; k < FINER; ++k) {
      const bool flying = gap > 0.0;
      contact = flying ? 0.0 : std::max(0.0, -STIFFNESS * gap - DAMPING * speed);
      const bool begun = i / sample_rate >= start;
      speed += dt * ((begun ? -PUSH : 0.0) + contact) / MASS;  // semi-implicit Euler
      gap += dt * speed;
    }
    force.push_back(contact);
  }
  return force;
}

}  // namespace smartmill::kalman
