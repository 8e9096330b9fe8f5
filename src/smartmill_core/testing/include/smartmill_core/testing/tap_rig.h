#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/units.h"

namespace smartmill {

/// A dynamometer of one mode, static gain 1.
inline ModalModel dynamometer() {
  ModalModel model;
  model.modes = {{930.0, 0.03, 0.9}};
  model.direct = 0.1;
  return model;
}

/// A workpiece on a force sensor with known modes, an automatic hammer, and a spindle: samples as from one
/// synchronous device. Hits are sin^2 pulses, whose spectrum vanishes above half the sample rate; forces pass
/// through the exact response of the sensor at eight times the sample rate.
class TapRig {
 public:
  static constexpr double RATE = 25600.0;    // [Hz]
  static constexpr std::size_t BLOCK = 256;  // samples
  static constexpr int FINER = 8;

  /// @param matrix measured over applied force: response of sensor axis [row] to a force along [column];
  /// absent: zero
  using Matrix = std::array<std::array<std::optional<ModalModel>, 3>, 3>;
  static Matrix diagonal(const ModalModel& sensor) {
    Matrix matrix;
    for (std::size_t axis = 0; axis < 3; ++axis) matrix[axis][axis] = sensor;
    return matrix;
  }

  TapRig(const Matrix& matrix, double start, std::uint32_t seed) : start_(start), random_(seed) {
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t column = 0; column < 3; ++column) {
        if (matrix[row][column]) {
          paths_.push_back({row, column, ModalFilter(*matrix[row][column], FINER * RATE, Hold::first_order)});
        }
      }
    }
  }

  double noise = 1.0;                                // [N] rms of one sample of the sensor
  double hammer_noise = 0.1;                         // [N] rms
  double peak = 300.0;                               // [N]; negative: hit from the opposite side
  double contact = 0.4e-3;                           // [s]
  double speed = 0.0;                                // [rad/s]
  std::function<std::array<double, 3>(double)> cut;  // [N] over the time since the start [s]

  double now() const { return start_ + static_cast<double>(index_) / RATE; }

  /// Schedules a hit.
  void strike(std::size_t axis) {
    axis_ = axis;
    blow_ = static_cast<double>(index_) / RATE + 0.0301;
  }

  /// Next blocks of all streams; hammer and sensor share stamp and index.
  struct Blocks {
    SampleBlock hammer, sensor;
    SpindleAngle angle;
  };
  Blocks next() {
    Blocks blocks;
    SampleBlock& h = blocks.hammer;
    SampleBlock& s = blocks.sensor;
    h.stamp = s.stamp = now();
    h.sample_rate = s.sample_rate = RATE;
    h.first_index = s.first_index = index_;
    h.channels = {"hammer", "gap"};
    h.units = {"N", "V"};
    s.channels = {"fx", "fy", "fz"};
    s.units = {"N", "N", "N"};
    blocks.angle = {now(), std::fmod(speed * static_cast<double>(index_) / RATE, units::TWO_PI), speed};
    std::normal_distribution<double> normal;
    for (std::size_t i = 0; i < BLOCK; ++i, ++index_) {
      std::array<double, 3> measured{};
      double hammer = 0.0;
      for (int fine = FINER - 1; fine >= 0; --fine) {
        const double t = (static_cast<double>(index_) - fine / static_cast<double>(FINER)) / RATE;
        std::array<double, 3> force = cut ? cut(t) : std::array<double, 3>{};
        const double into = (t - blow_) / contact;
        hammer = into > 0.0 && into < 1.0 ? std::abs(peak) * std::pow(std::sin(units::PI * into), 2) : 0.0;
        force[axis_] += peak < 0.0 ? -hammer : hammer;
        measured = {};
        for (Path& path : paths_) measured[path.row] += path.filter.step(force[path.column]);
        truth = force;
      }
      forces.push_back(truth);
      h.samples.insert(h.samples.end(), {hammer + hammer_noise * normal(random_), 0.0});
      for (const double m : measured) s.samples.push_back(m + noise * normal(random_));
    }
    return blocks;
  }

  std::vector<std::array<double, 3>> forces;  // [N] applied, at every sample so far

 private:
  struct Path {
    std::size_t row, column;
    ModalFilter filter;
  };
  double start_;
  std::mt19937 random_;
  std::vector<Path> paths_;
  std::uint64_t index_ = 0;
  std::size_t axis_ = 0;
  double blow_ = -1.0;
  std::array<double, 3> truth{};
};

}  // namespace smartmill
