#include "gallery/dynamometer_rig.h"

#include <cmath>
#include <random>
#include <utility>

#include "plant/elastic_dynamometer.h"
#include "plant/oscillator.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/units.h"

namespace smartmill::studies {
namespace {

constexpr std::size_t FINER = 8;                              // steps between two samples
constexpr double CUT_HEIGHT = 0.089, TAP_HEIGHT = 0.084;      // [m] above the plate
constexpr double CROSS_TALK = 0.01;                           // [1]
constexpr double YOUNG = 2.1e11, DENSITY = 7850.0;            // [N/m2], [kg/m3] steel
constexpr double TABLE_MASS = 600.0, TABLE_FREQUENCY = 75.0;  // [kg], [Hz]

/// Workpiece and the two jaws of a vice: height, width and length [m].
constexpr double BODIES[3][3] = {{0.09, 0.05, 0.10}, {0.07, 0.02, 0.12}, {0.08, 0.03, 0.12}};

plant::ElasticDynamometer dynamometer(std::size_t axis) {
  plant::ElasticDynamometer d;
  for (const auto& body : BODIES)
    d.beams.push_back({body[0], body[axis == 0 ? 2 : 1], body[axis == 0 ? 1 : 2], YOUNG, DENSITY});
  d.plate_mass = 14.0;
  d.plate_inertia = 0.05;
  d.stiffness = axis == 0 ? 7.14e8 : 9.61e8;
  d.stiffness_tilting = 1.2e7;
  d.table_mass = TABLE_MASS;
  d.table_stiffness = TABLE_MASS * std::pow(units::TWO_PI * TABLE_FREQUENCY, 2);
  d.damping_ratio = 0.03;
  return d;
}

/// The sensor in time, in steps of 1 / (FINER RATE).
class Simulated {
 public:
  Simulated(std::size_t axis, double height) {
    for (const plant::SensorMode& mode : modesOf(dynamometer(axis), axis, height)) {
      modes_.emplace_back(
          plant::Oscillator(mode.frequency, mode.damping_ratio, 1.0 / (FINER * DynamometerRig::RATE)),
          mode.input[axis] * mode.output[axis]);
    }
  }
  double step(double force) {
    double sum = 0.0;
    for (auto& [oscillator, gain] : modes_) {
      oscillator.step(force);
      sum += gain * oscillator.value();
    }
    return sum;
  }

 private:
  std::vector<std::pair<plant::Oscillator, double>> modes_;
};

/// The slot of section 5.3: four flutes; tool, depth and material are not printed.
MechanisticForce process() {
  return {{4, 19.05e-3, units::radFromDeg(30.0), {}},
          {796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3},
          {0.0, units::PI, 2e-3, 6e-5}};
}

}  // namespace

std::vector<std::complex<double>> DynamometerRig::response(std::size_t axis,
                                                           const std::vector<double>& frequencies) {
  const std::vector<plant::SensorMode> modes = modesOf(dynamometer(axis), axis, CUT_HEIGHT);
  std::vector<std::complex<double>> responses;
  for (const double frequency : frequencies) {
    std::complex<double> sum = 0.0;
    for (const plant::SensorMode& mode : modes) {
      const double r = frequency / mode.frequency;
      sum += mode.input[axis] * mode.output[axis] /
             std::complex<double>(1.0 - r * r, 2.0 * mode.damping_ratio * r);
    }
    responses.push_back(sum);
  }
  return responses;
}

DynamometerRig::Taps DynamometerRig::taps(std::size_t axis, int count, unsigned seed) {
  constexpr double PEAK = 500.0, CONTACT = 0.2e-3, BEFORE = 0.01, LENGTH = 0.2;  // [N], [s]
  constexpr double HAMMER_NOISE = 0.1;                                           // [N]
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  Taps taps;
  for (int tap = 0; tap < count; ++tap) {
    Simulated sensor(axis, TAP_HEIGHT);
    std::vector<double> hammer, response;
    // The hits are at different times between two samples.
    const double start = BEFORE + static_cast<double>(tap) / count / RATE;
    for (std::size_t i = 0; i < static_cast<std::size_t>(LENGTH * RATE); ++i) {
      double force = 0.0, measured = 0.0;
      for (std::size_t step = 1; step <= FINER; ++step) {
        const double time = (static_cast<double>(i) + static_cast<double>(step) / FINER) / RATE;
        const double into = (time - start) / CONTACT;
        force = into > 0.0 && into < 1.0 ? PEAK * std::pow(std::sin(units::PI * into), 2) : 0.0;
        measured = sensor.step(force);
      }
      hammer.push_back(force + HAMMER_NOISE * noise(random));
      response.push_back(measured + NOISE * noise(random));
    }
    taps.hammer.push_back(std::move(hammer));
    taps.response.push_back(std::move(response));
  }
  return taps;
}

DynamometerRig::Cut DynamometerRig::slot(double rpm, std::size_t samples, unsigned seed) {
  const double speed = units::radPerSecFromRpm(rpm);
  const MechanisticForce force = process();
  std::array<Simulated, 2> sensor{Simulated(0, CUT_HEIGHT), Simulated(1, CUT_HEIGHT)};
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, NOISE);
  Cut cut;
  for (std::size_t i = 0; i < samples; ++i) {
    std::array<double, 2> applied{}, measured{};
    for (std::size_t step = 1; step <= FINER; ++step) {
      const CuttingForce now =
          force.at(speed * (static_cast<double>(i) + static_cast<double>(step) / FINER) / RATE);
      applied = {now.fx, now.fy};
      for (std::size_t a = 0; a < 2; ++a) measured[a] = sensor[a].step(applied[a]);
    }
    cut.angle.push_back(std::fmod(speed * static_cast<double>(i + 1) / RATE, units::TWO_PI));
    for (std::size_t a = 0; a < 2; ++a) {
      cut.applied[a].push_back(applied[a]);
      cut.measured[a].push_back(measured[a] + CROSS_TALK * measured[1 - a] + noise(random));
    }
  }
  return cut;
}

}  // namespace smartmill::studies
