#include "loadmeter/turning_scene.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>

#include <boost/math/distributions/fisher_f.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/motor/anfis.h"

namespace smartmill::loadmeter {

namespace {

using units::TWO_PI;

constexpr double RATE = 1000.0;  // [Hz]
constexpr std::size_t SAMPLES = 2048;
constexpr double HALL_NOISE = 0.15;  // [A] RMS: 0.1 V/A
constexpr double AT_REST = std::numeric_limits<double>::quiet_NaN();

/// [1] probability of a larger F with these degrees of freedom.
double upperTail(double f, double numerator, double denominator) {
  return cdf(complement(boost::math::fisher_f(numerator, denominator), f));
}

// True laws of the machine, Table 1: slide X is pulled by its weight.
double currentX(double force) {
  return (force - 258.0) / -198.45;
}
double currentZ(double force) {
  return (force - 0.003) / 215.9;
}
// Spindle torque T = a dI^b: full torque below base speed, decreasing above (constant power).
double lawA(double rpm) {
  return rpm <= TurningCentre::BASE_SPEED ? 7.5 - 0.6 * (rpm - 800.0) / 770.0
                                          : 6.9 * std::pow(TurningCentre::BASE_SPEED / rpm, 0.8);
}
double lawB(double rpm) {
  return rpm <= TurningCentre::BASE_SPEED ? 1.12 + 0.04 * (rpm - 800.0) / 770.0
                                          : 1.16 - 0.06 * (rpm - TurningCentre::BASE_SPEED) / 830.0;
}
double phaseOf(int axis, double rpm, double feed) {
  // Spindle 184 Hz at 5000 rpm; feed motors 16 Hz at their fastest.
  if (axis == 1) return 184.0 * rpm / 5000.0;
  return std::clamp(16.0 * rpm * feed / 1.2, 3.0, 16.0);
}

}  // namespace

TurningCentre::TurningCentre(unsigned seed, const TurningVariances& variances)
    : random_(seed), variances_(variances) {
}

std::vector<double> TurningCentre::phaseCurrent(const std::vector<double>& range, double frequency) {
  std::vector<double> signal(range.size());
  std::uniform_real_distribution<double> uniform(0.0, TWO_PI);
  const double phase = uniform(random_), other = uniform(random_);
  for (std::size_t i = 0; i < signal.size(); ++i) {
    const double t = static_cast<double>(i) / RATE;
    // Inverter: fifth and seventh harmonic, and aliased switching.
    signal[i] = 0.5 * range[i] *
                    (std::sin(TWO_PI * frequency * t + phase) +
                     0.06 * std::sin(5.0 * TWO_PI * frequency * t + other) +
                     0.04 * std::sin(7.0 * TWO_PI * frequency * t + phase)) +
                0.1 * std::sin(TWO_PI * 333.0 * t + other) + HALL_NOISE * normal_(random_);
  }
  return signal;
}

double TurningCentre::measured(double range, double frequency) {
  return phaseRange(phaseCurrent(std::vector<double>(SAMPLES, range), frequency), RATE, frequency);
}

TurningCut TurningCentre::cut(double kc, bool x, bool z, double speed_rpm, double feed, double depth,
                              double radius) {
  TurningCut c;
  c.moves_x = x;
  c.moves_z = z;
  c.speed_rpm = speed_rpm;
  c.feed = feed;
  c.depth = depth;
  c.radius = radius;
  // The specific force decreases with feed; feed and passive force are shares of it. Facing swaps X and Z.
  const double power_force = kc * depth * 1e3 * std::pow(feed * 1e3, 0.78);
  const double feed_force = 0.55 * kc * depth * 1e3 * std::pow(feed * 1e3, 0.45);
  const double passive = 0.30 * kc * depth * 1e3 * std::pow(feed * 1e3, 0.5);
  std::array<double, 3> nominal{x && !z ? feed_force : passive, power_force, z ? feed_force : passive};
  if (x && z) nominal[0] = 0.7 * feed_force;
  // Beyond 258 N the current of the X motor changes sign, which its range does not show.
  if (x) nominal[0] = std::min(nominal[0], 190.0);
  for (std::size_t a = 0; a < 3; ++a) {
    c.force[a] = std::max(20.0, nominal[a] + std::sqrt(variances_.process[a]) * normal_(random_));
  }
  const auto forceWithNoise = [&](std::size_t a) {
    return std::max(15.0, c.force[a] + std::sqrt(variances_.sensor[a]) * normal_(random_));
  };
  c.current = {AT_REST, AT_REST, AT_REST};
  if (x) {
    // Not below zero: a range has no sign.
    c.current[0] = measured(std::abs(currentX(forceWithNoise(0))), phaseOf(0, speed_rpm, feed));
  }
  if (z) c.current[2] = measured(std::abs(currentZ(forceWithNoise(2))), phaseOf(2, speed_rpm, feed));
  const double torque = forceWithNoise(1) * (radius + 0.5 * depth);
  const double rise = std::pow(torque / lawA(speed_rpm), 1.0 / lawB(speed_rpm));
  const double air = 4.0 + 1.5 * speed_rpm / 2400.0;
  const double frequency = phaseOf(1, speed_rpm, feed);
  c.spindle_air = measured(air, frequency);
  c.current[1] = measured(air + rise, frequency);
  return c;
}

std::vector<TurningCut> TurningCentre::calibrationTests(std::size_t count) {
  const std::array<double, 7> speeds{800.0, 1000.0, 1250.0, 1500.0, 1800.0, 2100.0, 2400.0};
  const std::array<double, 4> depths{0.001, 0.0015, 0.002, 0.0025}, feeds{1e-4, 2e-4, 3e-4, 4e-4};
  std::uniform_real_distribution<double> uniform;
  std::vector<TurningCut> cuts;
  for (std::size_t i = 0; i < count; ++i) {
    // Every eighth faces; forces of X stay below where its current would change sign.
    const bool facing = i % 8 == 7;
    const double depth = facing ? 0.0003 + 0.0007 * uniform(random_) : depths[(i / 7) % 4];
    const double feed = facing ? 3e-5 + 1.2e-4 * uniform(random_) : feeds[(i / 28) % 4];
    const double kc = i % 20 == 0 ? 1850.0 : 1700.0;  // a second tool in one of 20 cuts
    cuts.push_back(cut(facing ? 0.45 * kc : kc, facing, !facing, speeds[i % 7], feed, depth,
                       0.015 + 0.02 * uniform(random_)));
  }
  return cuts;
}

std::vector<TurningCut> TurningCentre::predictionTests(std::size_t count) {
  std::uniform_real_distribution<double> uniform;
  const std::array<double, 3> materials{1700.0, 800.0, 700.0};  // mild steel, brass, aluminium 6061
  std::vector<TurningCut> cuts;
  for (std::size_t i = 0; i < count; ++i) {
    const double kc = materials[i % 3] * (0.95 + 0.05 * static_cast<double>(i % 9 / 3));
    const bool facing = i % 10 == 3, contour = i % 10 == 7;
    const double depth =
        facing || contour ? 0.0003 + 0.0007 * uniform(random_) : 0.001 + 0.0015 * uniform(random_);
    const double feed = facing || contour ? 3e-5 + 1.2e-4 * uniform(random_) : 1e-4 + 3e-4 * uniform(random_);
    cuts.push_back(cut(facing || contour ? 620.0 + 70.0 * static_cast<double>(i % 3) : kc, facing || contour,
                       !facing, 800.0 + 1600.0 * uniform(random_), feed, depth,
                       0.015 + 0.02 * uniform(random_)));
  }
  return cuts;
}

std::vector<TurningCut> TurningCentre::replications(std::size_t count) {
  std::vector<TurningCut> cuts;
  for (std::size_t i = 0; i < count; ++i) cuts.push_back(cut(860.0, false, true, 1000.0, 2e-4, 0.002, 0.025));
  return cuts;
}

namespace {

double lever(const TurningCut& c) {
  return c.radius + 0.5 * c.depth;
}
double rise(const TurningCut& c) {
  return c.current[1] - c.spindle_air;
}

void tally(const std::vector<double>& truth, const std::vector<double>& estimate, std::size_t axis,
           Agreement* a) {
  double left = 0.0, total = 0.0, middle = 0.0;
  const double n = static_cast<double>(truth.size());
  for (const double t : truth) middle += t / n;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    left += (truth[i] - estimate[i]) * (truth[i] - estimate[i]);
    total += (truth[i] - middle) * (truth[i] - middle);
  }
  a->rmse[axis] = std::sqrt(left / n);
  a->r_squared[axis] = 1.0 - left / total;
  a->count[axis] = static_cast<int>(truth.size());
}

using Inputs = std::function<std::vector<double>(const TurningCut&)>;
struct InputArray {
  const char* name;
  Inputs of;
};

/// A third of the prediction tests selects among the input arrays, as in the paper.
struct Choice {
  const InputArray* array = nullptr;
  std::unique_ptr<Anfis> anfis;

  double operator()(const TurningCut& c) const { return (*anfis)(array->of(c)); }
};

/// Trains one network per input array on the calibration tests and selects the array with the least error in
/// `validation`, as in the paper. The calibration has only one material, where feed and depth determine the
/// force; cross-validation within it would not reveal that this fails for others.
Choice chooseAnfis(const std::vector<TurningCut>& cuts, const std::vector<double>& output,
                   const std::vector<TurningCut>& validation, const std::vector<double>& truth,
                   const std::vector<InputArray>& arrays) {
  Anfis::Parameters parameters;
  parameters.epochs = 20;
  double least = std::numeric_limits<double>::infinity();
  Choice best;
  for (const InputArray& array : arrays) {
    std::vector<std::vector<double>> x;
    for (const TurningCut& c : cuts) x.push_back(array.of(c));
    auto anfis = std::make_unique<Anfis>(x, output, parameters);
    double squares = 0.0;
    for (std::size_t i = 0; i < validation.size(); ++i) {
      const double error = (*anfis)(array.of(validation[i])) - truth[i];
      squares += error * error;
    }
    if (squares < least) {
      least = squares;
      best = {&array, std::move(anfis)};
    }
  }
  return best;
}

// The torque is learnt instead of the force, since the motor current depends on torque and the radius is
// known.
const std::vector<InputArray>& torqueArrays() {
  static const std::vector<InputArray> ARRAYS{
      {"{dI, N}",
       [](const TurningCut& c) {
         return std::vector<double>{rise(c), c.speed_rpm};
       }},
      {"{dI, N, f}",
       [](const TurningCut& c) {
         return std::vector<double>{rise(c), c.speed_rpm, c.feed};
       }},
      {"{dI, N, ap}",
       [](const TurningCut& c) {
         return std::vector<double>{rise(c), c.speed_rpm, c.depth};
       }},
      {"{dI, N, f ap}", [](const TurningCut& c) {
         return std::vector<double>{rise(c), c.speed_rpm, c.feed * c.depth};
       }}};
  return ARRAYS;
}

const std::vector<InputArray>& feedForceArrays() {
  static const std::vector<InputArray> ARRAYS{
      {"{I}", [](const TurningCut& c) { return std::vector<double>{c.current[2]}; }},
      {"{I, f}",
       [](const TurningCut& c) {
         return std::vector<double>{c.current[2], c.feed};
       }},
      {"{I, ap}",
       [](const TurningCut& c) {
         return std::vector<double>{c.current[2], c.depth};
       }},
      {"{I, f, ap}", [](const TurningCut& c) {
         return std::vector<double>{c.current[2], c.feed, c.depth};
       }}};
  return ARRAYS;
}

double torqueOf(const TurningCut& c) {
  return c.force[1] * lever(c);
}

/// Models from the calibration tests: lines for the slides, torque law of the spindle, and the networks.
struct Calibration {
  Line x, z;
  TorquePowerLaw law;
  Choice torque, feed_force;

  /// Main force, by the law of the spindle.
  double mainForce(const TurningCut& c) const {
    return law.torque(c.speed_rpm, std::max(rise(c), 1e-3)) / lever(c);
  }
};

Calibration calibrate(const std::vector<TurningCut>& tests, const std::vector<TurningCut>& validation) {
  std::vector<double> ix, fx, iz, fz, torque, torque_truth, z_truth;
  std::vector<TurningCut> z_cuts, z_validation;
  std::vector<SpindleCut> spindle;
  for (const TurningCut& c : tests) {
    if (c.moves_x) ix.push_back(c.current[0]), fx.push_back(c.force[0]);
    if (c.moves_z) iz.push_back(c.current[2]), fz.push_back(c.force[2]), z_cuts.push_back(c);
    torque.push_back(torqueOf(c));
    spindle.push_back({c.speed_rpm, rise(c), torque.back()});
  }
  for (const TurningCut& c : validation) {
    torque_truth.push_back(torqueOf(c));
    if (c.moves_z) z_validation.push_back(c), z_truth.push_back(c.force[2]);
  }
  return {fitLine(ix, fx), fitLine(iz, fz), TorquePowerLaw(spindle, TurningCentre::BASE_SPEED),
          chooseAnfis(tests, torque, validation, torque_truth, torqueArrays()),
          chooseAnfis(z_cuts, fz, z_validation, z_truth, feedForceArrays())};
}

void compare(const Calibration& calibration, const std::vector<TurningCut>& tests, TurningResult* result) {
  std::array<std::vector<double>, 3> truth, regression, anfis;
  for (const TurningCut& c : tests) {
    if (c.moves_x) {
      truth[0].push_back(c.force[0]);
      regression[0].push_back(calibration.x.at(c.current[0]));
      anfis[0].push_back(regression[0].back());
    }
    truth[1].push_back(c.force[1]);
    regression[1].push_back(calibration.mainForce(c));
    anfis[1].push_back(calibration.torque(c) / lever(c));
    if (c.moves_z) {
      truth[2].push_back(c.force[2]);
      regression[2].push_back(calibration.z.at(c.current[2]));
      anfis[2].push_back(calibration.feed_force(c));
    }
  }
  for (std::size_t a = 0; a < 3; ++a) {
    tally(truth[a], regression[a], a, &result->regression);
    tally(truth[a], anfis[a], a, &result->anfis);
  }
  result->truth = truth;
  result->predicted = regression;
}

void compareVariances(const Calibration& calibration, const std::vector<TurningCut>& replications,
                      TurningResult* result) {
  std::array<std::vector<double>, 2> dynamometer, current;
  for (const TurningCut& c : replications) {
    dynamometer[0].push_back(c.force[1]);
    current[0].push_back(calibration.mainForce(c));
    dynamometer[1].push_back(c.force[2]);
    current[1].push_back(calibration.z.at(c.current[2]));
  }
  result->fy = splitVariance(dynamometer[0], current[0]);
  result->fz = splitVariance(dynamometer[1], current[1]);
}

}  // namespace

TurningResult studyTurning(unsigned seed, const TurningVariances& variances, std::size_t replications) {
  TurningCentre centre(seed, variances);
  const std::vector<TurningCut> calibration_tests = centre.calibrationTests(120);
  const std::vector<TurningCut> prediction = centre.predictionTests(300);
  const auto third = prediction.begin() + static_cast<std::ptrdiff_t>(prediction.size() / 3);
  const Calibration calibration = calibrate(calibration_tests, {prediction.begin(), third});
  TurningResult result;
  result.x = calibration.x;
  result.z = calibration.z;
  result.fit_x = result.x.r_squared;
  result.fit_y = calibration.law.rSquared();
  result.fit_z = result.z.r_squared;
  result.fy_inputs = calibration.torque.array->name;
  result.fz_inputs = calibration.feed_force.array->name;
  compare(calibration, {third, prediction.end()}, &result);
  compareVariances(calibration, centre.replications(replications), &result);
  return result;
}

SlideLoad slideLoad(const Line& calibration, double air_current, double air_current_reverse,
                    double current_std) {
  const double m = calibration.slope.value, size = std::abs(m);
  // W + R = m Ia; against it the weight changes sign: -W + R = |m| Ia'.
  const double with = m * air_current, against = size * air_current_reverse;
  SlideLoad load;
  load.friction.value = 0.5 * (with + against);
  load.weight.value = 0.5 * (with - against);
  const double from_current = size * current_std / std::sqrt(2.0);
  load.friction.std_dev = std::hypot(from_current, load.friction.value * calibration.slope.std_dev / size);
  load.weight.std_dev = std::hypot(from_current, load.weight.value * calibration.slope.std_dev / size);
  return load;
}

VarianceSplit splitVariance(const std::vector<double>& dynamometer, const std::vector<double>& current) {
  if (dynamometer.size() < 3 || current.size() < 3)
    throw Error("variance split: expected at least three replications");
  VarianceSplit s;
  s.process_mean = mean(dynamometer);
  s.current_mean = mean(current);
  s.process_variance = std::pow(standardDeviation(dynamometer), 2);
  s.current_variance = std::pow(standardDeviation(current), 2);
  s.sensor_variance = std::max(0.0, s.current_variance - s.process_variance);
  const double na = static_cast<double>(dynamometer.size()), nb = static_cast<double>(current.size());
  const double within = ((na - 1.0) * s.process_variance + (nb - 1.0) * s.current_variance) / (na + nb - 2.0);
  const double difference = s.process_mean - s.current_mean;
  s.f_means = difference * difference / (within * (1.0 / na + 1.0 / nb));
  s.p_means = upperTail(s.f_means, 1.0, na + nb - 2.0);
  s.p_variances = upperTail(s.current_variance / s.process_variance, nb - 1.0, na - 1.0);
  return s;
}

}  // namespace smartmill::loadmeter
