#include "smartmill_kalman/filter/harmonic_filter.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <new>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/modal/state_space.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/campaign_compensation.h"
#include "smartmill_kalman/filter/riccati.h"

namespace {

std::size_t allocations = 0;

}  // namespace

// The compiler inlines these and then takes malloc and delete for a mismatch.
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"
void* operator new(std::size_t size) {
  ++allocations;
  if (void* p = std::malloc(size)) return p;
  throw std::bad_alloc();
}
// Of what takes its memory without a throw (a stable sort).
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++allocations;
  return std::malloc(size);
}
void operator delete(void* p) noexcept {
  std::free(p);
}
void operator delete(void* p, std::size_t) noexcept {
  std::free(p);
}
#include "smartmill_kalman_testing/reference_case.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0;  // [Hz]

ModalModel sensor(double frequency) {
  ModalModel model;
  model.modes = {{frequency, 0.03, 0.9}};
  model.direct = 0.1;
  return model;
}

TEST(StationaryCovariance, solvesTheScalarEquation) {
  // Random walk with measurement noise: p^2 = q (p + r), so p = (q + sqrt(q^2 + 4 q r)) / 2.
  const double q = 0.3, r = 2.0;
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(1, 1);
  const Eigen::MatrixXd p = stationaryCovariance(one, q * one, one.row(0), r);
  EXPECT_NEAR(p(0, 0), 0.5 * (q + std::sqrt(q * q + 4.0 * q * r)), 1e-12);
}

TEST(StationaryCovariance, leavesNoResidual) {
  Eigen::MatrixXd phi(3, 3), q = Eigen::MatrixXd::Zero(3, 3);
  phi << 0.9, 0.2, 0.1, -0.2, 0.9, 0.3, 0.0, 0.0, 1.0;
  q(2, 2) = 0.01;
  Eigen::RowVectorXd c(3);
  c << 1.0, 0.0, 0.5;
  const Eigen::MatrixXd p = stationaryCovariance(phi, q, c, 0.5);
  const Eigen::MatrixXd updated = p - p * c.transpose() * c * p / ((c * p * c.transpose())(0) + 0.5);
  EXPECT_LT((phi * updated * phi.transpose() + q - p).norm(), 1e-11 * p.norm());
}

TEST(HarmonicFilter, recoversConstantAndHarmonicsThroughTheSensor) {
  // Steady state of a constant and two harmonics, known in closed form on both sides of the sensor.
  const ModalModel model = sensor(930.0);
  const double speed = units::TWO_PI * 232.5;
  HarmonicFilter filter(model, speed, RATE, {});
  double worst = 0.0;
  for (int i = 0; i < 256000; ++i) {
    const double t = i / RATE;
    const auto wave = [&](double f, double amplitude) {
      return std::polar(amplitude, units::TWO_PI * f * t);
    };
    const double applied = 50.0 + (wave(232.5, 30.0) + wave(930.0, 100.0)).real();
    const double measured =
        50.0 +
        (model.response(232.5) * wave(232.5, 30.0) + model.response(930.0) * wave(930.0, 100.0)).real();
    const double estimate = filter.step(measured);
    if (t > 8.0) worst = std::max(worst, std::abs(estimate - applied));
  }
  // The harmonic next to the sensor's zero near 2940 Hz passes it by 0.6 % and settles with 0.2 s: 40 time
  // constants.
  EXPECT_LT(worst, 1e-6);
}

// Dunwoody section 5.3: slot at 13950 rpm with four teeth, tooth passing at the sensor's first mode of 930
// Hz.
TEST(HarmonicFilter, rangeAndWaveformAtTheSensorsResonance) {
  const ToolGeometry tool{4, 19.05e-3, units::radFromDeg(30.0), {}};
  const CuttingCoefficients aluminium{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};
  const MechanisticForce process(tool, aluminium, {0.0, units::PI, 2e-3, 6e-5});
  const double speed = units::radPerSecFromRpm(13950.0);
  const std::array<double, 2> frequency{{930.0, 1080.0}};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    ModalFilter dynamometer(sensor(frequency[axis]), RATE, Hold::first_order);
    HarmonicFilter filter(sensor(frequency[axis]), speed, RATE, {});
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0.0, 1.0);
    std::vector<double> truth, raw, estimate;
    double error = 0.0, norm = 0.0;
    for (int i = 0; i < 12800; ++i) {
      const CuttingForce force = process.at(speed * i / RATE);
      const double applied = axis == 0 ? force.fx : force.fy;
      const double measured = dynamometer.step(applied) + noise(random);
      const double found = filter.step(measured);
      if (i < 7680) continue;  // 0.3 s after engagement
      truth.push_back(applied);
      raw.push_back(measured);
      estimate.push_back(found);
      error += (found - applied) * (found - applied);
      norm += applied * applied;
    }
    const auto range = [](const std::vector<double>& v) { return percentile(v, 0.9) - percentile(v, 0.1); };
    EXPECT_GT(std::abs(range(raw) / range(truth) - 1.0), 0.3) << "axis " << axis;
    EXPECT_LT(std::abs(range(estimate) / range(truth) - 1.0), 0.05) << "axis " << axis;
    EXPECT_LT(std::sqrt(error / norm), 0.10) << "axis " << axis;
  }
}

// Dunwoody section 5.3: six speeds, tooth passing from 50 to 1200 Hz around the sensor's modes. The force
// is independent of the speed: its 10th to 90th percentile range must stay within 5 %, and the waveform
// within 10 % of the truth.
class SixSpeeds : public testing::TestWithParam<double> {};

TEST_P(SixSpeeds, rangeStaysAndWaveformIsRight) {
  const ToolGeometry tool{4, 19.05e-3, units::radFromDeg(30.0), {}};
  const CuttingCoefficients aluminium{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};
  const MechanisticForce process(tool, aluminium, {0.0, units::PI, 2e-3, 6e-5});
  const double speed = units::radPerSecFromRpm(GetParam());
  const auto range = [](const std::vector<double>& v) { return percentile(v, 0.9) - percentile(v, 0.1); };
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto applied = [&](double angle) {
      const CuttingForce f = process.at(std::fmod(angle, units::TWO_PI));
      return axis == 0 ? f.fx : f.fy;
    };
    // Any speed shows the same revolution.
    std::vector<double> revolution;
    for (int i = 0; i < 7200; ++i) revolution.push_back(applied(units::TWO_PI * i / 7200.0));
    ModalFilter dynamometer(sensor(axis == 0 ? 930.0 : 1080.0), 4.0 * RATE, Hold::first_order);
    HarmonicFilterParameters parameters;
    parameters.max_harmonics = 50;  // as the node's, see launch/config/kalman.yaml
    HarmonicFilter filter(sensor(axis == 0 ? 930.0 : 1080.0), speed, RATE, parameters);
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0.0, 1.0);
    std::vector<double> estimate;
    double error = 0.0, norm = 0.0;
    const int count = 20480, settled = 10240;
    for (int i = 0; i < count; ++i) {
      double measured = 0.0;
      for (int fine = 3; fine >= 0; --fine)
        measured = dynamometer.step(applied(speed * (i + 1 - 0.25 * fine) / RATE));
      const double truth = applied(speed * (i + 1) / RATE);
      const double found = filter.step(measured + noise(random));
      if (i < settled) continue;
      estimate.push_back(found);
      error += (found - truth) * (found - truth);
      norm += truth * truth;
    }
    EXPECT_LT(std::abs(range(estimate) / range(revolution) - 1.0), 0.05) << "axis " << axis;
    EXPECT_LT(std::sqrt(error / norm), 0.10) << "axis " << axis;
  }
}

INSTANTIATE_TEST_SUITE_P(Dunwoody, SixSpeeds,
                         testing::Values(750.0, 4500.0, 9000.0, 13950.0, 16200.0, 18000.0));

TEST(HarmonicFilter, allocatesNothingPerSample) {
  HarmonicFilter filter(sensor(930.0), units::TWO_PI * 150.0, RATE, {});
  const std::size_t before = allocations;
  for (int i = 0; i < 20000; ++i) filter.step(i % 171);
  EXPECT_EQ(allocations, before);
}

TEST(HarmonicFilter, stateGoesToAndFroAndALayoutChangesWithoutAJump) {
  const double speed = units::TWO_PI * 150.0;
  HarmonicFilter filter(sensor(930.0), speed, RATE, {});
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 10.0);
  for (int i = 0; i < 5000; ++i) filter.step(noise(random) + 100.0 * std::cos(speed * i / RATE));
  const std::vector<double> state = filter.pairs().state();
  HarmonicFilter other = filter;
  other.reset();
  other.setState(state);
  const std::vector<double> again = other.pairs().state();
  for (std::size_t i = 0; i < state.size(); ++i) EXPECT_NEAR(again[i], state[i], 1e-9);
  // The force right after a change of speed, of the gains or of both is what it was to be.
  const double expected = HarmonicFilter(filter).predict();
  HarmonicFilter retuned = filter;
  retuned.retune(sensor(930.0), 1.01 * speed);
  EXPECT_NEAR(retuned.predict(), expected, 1e-9);
  HarmonicFilter next(sensor(930.0), 1.005 * speed, RATE, {});
  next.continueFrom(filter);
  EXPECT_NEAR(next.predict(), expected, 1e-9);
}

// The uncoupled coordinates are the coupled ones in other clothes: against the plain matrix recursion.
TEST(HarmonicFilter, isTheMatrixRecursion) {
  const ModalModel model = sensor(930.0);
  const double speed = units::TWO_PI * 150.0, tau = 0.2 / 150.0;
  const int harmonics = 5;
  const HarmonicGain gain = designHarmonicGain(model, speed, RATE, harmonics, 1.0, tau, tau);
  HarmonicFilter filter({gain}, model, speed, RATE);
  const StateSpace modes = stateSpace(model);
  const Eigen::Index f = 2 * harmonics + 1, n = 2 + f;
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n, n);
  Eigen::RowVectorXd c = Eigen::RowVectorXd::Zero(n), d = Eigen::RowVectorXd::Zero(n);
  d(2) = 1.0;
  for (Eigen::Index k = 1; k <= harmonics; ++k) {
    d(2 + 2 * k - 1) = 1.0;
    a(2 + 2 * k - 1, 2 + 2 * k) = static_cast<double>(k) * speed;
    a(2 + 2 * k, 2 + 2 * k - 1) = -static_cast<double>(k) * speed;
  }
  a.topLeftCorner(2, 2) = modes.a;
  a.topRows(2) += modes.b * d;
  c.head(2) = modes.c;
  c += model.direct * d;
  const Eigen::MatrixXd phi = linear::exponential(a / RATE);
  const Eigen::VectorXd k = Eigen::Map<const Eigen::VectorXd>(gain.filter.data(), n);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 50.0);
  for (int i = 0; i < 3000; ++i) {
    const double measured = noise(random);
    x += k * (measured - c * x);
    ASSERT_NEAR(filter.step(measured), d * x, 1e-8);
    x = phi * x;
  }
}

TEST(HarmonicFilter, innovationHasTheExpectedSize) {
  const double speed = units::TWO_PI * 100.0;
  HarmonicFilter filter(sensor(930.0), speed, RATE, {});
  // Noise alone: the innovation is the noise plus what the filter took for force, below the design's figure
  // but not below the noise.
  const double rms = innovationUnderNoise(filter, 51200, 0);
  EXPECT_GT(rms, 0.98);
  EXPECT_LT(rms, 1.02 * filter.innovationStd());
}

TEST(HarmonicFilter, coastsThroughAGap) {
  const double speed = units::TWO_PI * 232.5;
  HarmonicFilter filter(sensor(930.0), speed, RATE, {});
  const auto response = sensor(930.0).response(232.5);
  double worst = 0.0;
  for (int i = 0; i < 256000; ++i) {
    const double phase = speed * i / RATE;
    const double estimate = i > 250000 && i < 250100
                                ? filter.predict()
                                : filter.step((response * std::polar(100.0, phase)).real());
    if (i > 245000) worst = std::max(worst, std::abs(estimate - 100.0 * std::cos(phase)));
  }
  EXPECT_LT(worst, 1e-6);
}

// Noise alone: the amplitude of a harmonic is complex normal, u = |a|^2 over its mean is exponential, and a
// weight max(0, 1 - c/u) leaves the share E[(1 - c/u)^2 u; u > c] = (1 - c) exp(-c) + c^2 E1(c) of its power.
// The covariance of the design is at least that of the noise (c = 1: E1(1) = 0.2194), and twice as much where
// an exponential average forgets slowly (c = 2: 0.0603; E1 by Abramowitz and Stegun table 5.1).
TEST(HarmonicFilter, weightsLeaveTheShareOfNoiseThatTheoryGives) {
  constexpr double NOISE = 2.0;  // [N]
  ModalModel model;
  model.modes.push_back({800.0, 0.03, 0.9});
  model.direct = 0.1;
  HarmonicFilterParameters parameters;
  double weighted = 0.0, all = 0.0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    HarmonicFilter filter(model, units::TWO_PI * 150.0, RATE, parameters), plain = filter;
    filter.setWeighting(true);
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0.0, NOISE);  // not that of the design, 1 N
    for (int i = 0; i < 40000; ++i) {
      const double measured = noise(random), force = filter.step(measured), without = plain.step(measured);
      if (i < 15000 || !filter.memory().settled()) continue;
      weighted += force * force;
      all += without * without;
    }
  }
  EXPECT_LT(weighted / all, 0.2194);
  EXPECT_GT(weighted / all, 0.0603);
}

// A harmonic of ten times its standard deviation or more is not changed by more than its noise.
TEST(HarmonicFilter, weightsKeepWhatIsNoNoise) {
  ModalModel model;
  model.modes.push_back({800.0, 0.03, 0.9});
  model.direct = 0.1;
  const double speed = units::TWO_PI * 150.0;
  HarmonicFilter filter(model, speed, RATE, {}), plain = filter;
  filter.setWeighting(true);
  const auto force = [&](int i) {
    const double angle = speed * i / RATE;
    return 60.0 + 50.0 * std::cos(4.0 * angle) + 20.0 * std::cos(20.0 * angle + 1.0);
  };
  ModalFilter plant(model, RATE, Hold::first_order);
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 1.0);
  double weighted = 0.0, unweighted = 0.0;
  for (int i = 0; i < 60000; ++i) {
    const double measured = plant.step(force(i)) + noise(random), one = filter.step(measured),
                 other = plain.step(measured);
    if (i < 20000) continue;
    weighted += std::pow(one - force(i), 2);
    unweighted += std::pow(other - force(i), 2);
  }
  EXPECT_GT(filter.weight(4), 0.99);
  EXPECT_GT(filter.weight(20), 0.9);
  EXPECT_LT(weighted, 0.6 * unweighted);
}

TEST(HarmonicFilter, refusesImpossibleParameters) {
  HarmonicFilterParameters parameters;
  parameters.noise_rms = -1.0;
  EXPECT_THROW(HarmonicFilter(sensor(930.0), 100.0, RATE, parameters), Error);
  EXPECT_THROW(HarmonicFilter(sensor(930.0), 0.0, RATE, {}), Error);
}

TEST(IdentifySensor, findsTheModeFromNoisyHits) {
  const ModalModel truth = sensor(930.0);
  std::mt19937 random(11);
  std::normal_distribution<double> noise(0.0, 1.0);
  std::vector<std::vector<double>> hammer, response;
  for (int hit = 0; hit < 5; ++hit) {
    ModalFilter dynamometer(truth, RATE, Hold::first_order);
    std::vector<double> h, f;
    for (int i = 0; i < 5120; ++i) {
      const double t = (i - 256) / RATE;
      const double force = t > 0.0 && t < 5e-4 ? 500.0 * std::sin(units::PI * t / 5e-4) : 0.0;
      h.push_back(force + 0.2 * noise(random));
      f.push_back(dynamometer.step(force) + noise(random));
    }
    hammer.push_back(h);
    response.push_back(f);
  }
  const ModalFit fit = identifySensor(hammer, response, RATE, {100.0, 3000.0, 3});
  ASSERT_EQ(fit.model.modes.size(), 1u);
  EXPECT_NEAR(fit.model.modes[0].frequency, 930.0, 930.0 * 0.002);
  EXPECT_NEAR(fit.model.modes[0].damping_ratio, 0.03, 0.03 * 0.05);
  EXPECT_NEAR(fit.model.staticGain(), 1.0, 1e-12);
}

}  // namespace
}  // namespace smartmill::kalman
