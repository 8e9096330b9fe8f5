#include <cmath>
#include <complex>
#include <limits>
#include <numeric>
#include <random>
#include <thread>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/derivative.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;

std::vector<double> noise(std::size_t n, double rms, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> values(n);
  for (double& value : values) value = rms * normal(random);
  return values;
}

TEST(Fourier, equalsItsDefinition) {
  for (const std::size_t n : {std::size_t{1}, std::size_t{2}, std::size_t{15}, std::size_t{64}}) {
    const std::vector<double> signal = noise(n, 1.0, 1);
    const std::vector<Complex> spectrum = fourier(signal);
    ASSERT_EQ(spectrum.size(), n / 2 + 1);
    for (std::size_t k = 0; k < spectrum.size(); ++k) {
      Complex expected = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        expected +=
            signal[i] * std::polar(1.0, -units::TWO_PI * static_cast<double>(i * k) / static_cast<double>(n));
      }
      EXPECT_NEAR(std::abs(spectrum[k] - expected), 0.0, 1e-12) << n << " samples, line " << k;
    }
  }
}

TEST(Fourier, conservesEnergyAndIsInvertible) {
  for (const std::size_t n : {std::size_t{1000}, std::size_t{1001}}) {
    const std::vector<double> signal = noise(n, 2.0, 2);
    const std::vector<Complex> spectrum = fourier(signal);
    double energy = 0.0;
    for (std::size_t k = 0; k < spectrum.size(); ++k) {
      const bool single = k == 0 || 2 * k == n;  // the other lines represent two each
      energy += (single ? 1.0 : 2.0) * std::norm(spectrum[k]) / static_cast<double>(n);
    }
    EXPECT_NEAR(energy / std::inner_product(signal.begin(), signal.end(), signal.begin(), 0.0), 1.0, 1e-13);
    const std::vector<double> back = inverseFourier(spectrum, n);
    for (std::size_t i = 0; i < n; ++i) ASSERT_NEAR(back[i], signal[i], 1e-13);
  }
}

TEST(Fourier, isThreadSafe) {
  const std::vector<double> signal = noise(4099, 1.0, 3);
  const std::vector<Complex> expected = fourier(signal);
  std::vector<int> differing(4, 0);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 20; ++i) differing[static_cast<std::size_t>(t)] += fourier(signal) != expected;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(std::accumulate(differing.begin(), differing.end(), 0), 0);
}

TEST(Fourier, linesAndErrors) {
  EXPECT_EQ(fourierFrequencies(8, 800.0), (std::vector<double>{0.0, 100.0, 200.0, 300.0, 400.0}));
  EXPECT_EQ(fourierFrequencies(5, 500.0), (std::vector<double>{0.0, 100.0, 200.0}));
  EXPECT_THROW(fourier({}), Error);
  EXPECT_THROW(inverseFourier({1.0, 2.0}, 8), Error);
}

std::vector<double> halfSine(std::size_t n, std::size_t start, std::size_t width, double peak) {
  std::vector<double> force(n, 0.0);
  for (std::size_t i = 0; i <= width; ++i) {
    force[start + i] = peak * std::sin(units::PI * static_cast<double>(i) / static_cast<double>(width));
  }
  return force;
}

// Dunwoody 4.3.1: for a hit of 0.4 ms at 50 kHz in a record of 0.2 s "6 %" of the error remain (eq. 4.16);
// one printed digit.
TEST(ImpactWindow, passesTheNoiseThatTheThesisStates) {
  const std::vector<double> window = impactWindow(halfSine(10000, 500, 20, 150.0));
  EXPECT_NEAR(rms(window), 0.06, 0.005);
}

TEST(ImpactWindow, isOneDuringTheContactAndFallsSmoothly) {
  const std::vector<double> force = halfSine(1000, 300, 40, 100.0);
  const std::vector<double> window = impactWindow(force);
  for (std::size_t i = 300; i <= 340; ++i) EXPECT_EQ(window[i], 1.0) << i;
  // The half-sine crosses 10 % between 1 and 2 samples from its ends: shoulder 19, plateau 28.5, end 47.5
  // samples.
  EXPECT_EQ(window[320 - 28], 1.0);
  EXPECT_LT(window[320 - 29], 1.0);
  EXPECT_EQ(window[320 - 48], 0.0);
  EXPECT_EQ(window[320 + 48], 0.0);
  EXPECT_NEAR(window[320 + 38], 0.5 * (std::cos(units::PI * 9.5 / 19.0) + 1.0), 1e-12);
  for (std::size_t i = 321; i < 999; ++i) EXPECT_LE(window[i + 1], window[i]);
  EXPECT_THROW(impactWindow(std::vector<double>(100, 0.0)), Error);
  EXPECT_THROW(impactWindow({}), Error);
}

TEST(ImpactWindow, findsASecondHit) {
  std::vector<double> force = halfSine(1000, 300, 20, 100.0);
  EXPECT_FALSE(hasSecondHit(force, 0.05));
  const std::vector<double> second = halfSine(1000, 600, 20, 8.0);
  for (std::size_t i = 0; i < force.size(); ++i) force[i] += second[i];
  EXPECT_TRUE(hasSecondHit(force, 0.05));
  EXPECT_FALSE(hasSecondHit(force, 0.1));
}

TEST(HannWindow, isPeriodic) {
  EXPECT_NEAR(mean(hannWindow(64)), 0.5, 1e-15);
  const std::vector<double> window = hannWindow(4);
  EXPECT_NEAR(window[0], 0.0, 1e-15);
  EXPECT_NEAR(window[1], 0.5, 1e-15);
  EXPECT_NEAR(window[2], 1.0, 1e-15);
  EXPECT_NEAR(window[3], 0.5, 1e-15);
}

// Hits of white force through a pure delay-free gain of 2, with noise on both channels.
FrfEstimator hits(int count, double force_noise, double response_noise, unsigned seed) {
  constexpr std::size_t N = 512;
  FrfEstimator estimator(1000.0, N);
  for (int hit = 0; hit < count; ++hit) {
    const unsigned at = 1000 * seed + static_cast<unsigned>(3 * hit);
    std::vector<double> force = noise(N, 1.0, at + 1), response = force;
    for (double& value : response) value *= 2.0;
    const std::vector<double> in = noise(N, force_noise, at + 2), out = noise(N, response_noise, at + 3);
    for (std::size_t i = 0; i < N; ++i) {
      force[i] += in[i];
      response[i] += out[i];
    }
    estimator.add(force, response);
  }
  return estimator;
}

Complex average(const FrequencyResponse& frf) {
  return std::accumulate(frf.value.begin(), frf.value.end(), Complex(0.0)) / static_cast<double>(frf.size());
}

TEST(FrfEstimator, withoutNoiseBothEstimatesAreExact) {
  const FrfEstimator estimator = hits(3, 0.0, 0.0, 1);
  for (const FrequencyResponse& frf : {estimator.h1("m/N"), estimator.h2("m/N")}) {
    for (std::size_t k = 0; k < frf.size(); ++k) {
      EXPECT_NEAR(std::abs(frf.value[k] - 2.0), 0.0, 1e-12);
      EXPECT_NEAR(frf.coherence[k], 1.0, 1e-12);
    }
    EXPECT_EQ(frf.averages, 3);
    EXPECT_EQ(frf.unit, "m/N");
  }
}

// Force noise of share q of the force's power lowers H1 to 1 / (1 + q); response noise of share p of the
// response's raises H2 to 1 + p; coherence 1 / ((1 + q) (1 + p)). Means over 257 lines of 200 hits: error
// about 1e-3.
TEST(FrfEstimator, biasAndCoherenceAgreeWithTheory) {
  const FrfEstimator input = hits(200, 0.5, 0.0, 2);
  EXPECT_NEAR(average(input.h1("1")).real(), 2.0 / 1.25, 0.01);
  EXPECT_NEAR(average(input.h2("1")).real(), 2.0, 0.01);
  const FrfEstimator output = hits(200, 0.0, 1.0, 3);
  EXPECT_NEAR(average(output.h1("1")).real(), 2.0, 0.01);
  EXPECT_NEAR(average(output.h2("1")).real(), 2.0 * 1.25, 0.015);
  EXPECT_NEAR(mean(output.h1("1").coherence), 0.8, 0.005);
}

// With response noise only, the stated standard deviation is that of the error: mean over many lines of
// error^2 / std^2.
TEST(FrfEstimator, standardDeviationFromScatterIsCalibrated) {
  double error = 0.0, stated = 0.0;
  for (unsigned seed = 10; seed < 30; ++seed) {
    const FrequencyResponse frf = hits(10, 0.0, 0.5, seed).h1("1");
    for (std::size_t k = 0; k < frf.size(); ++k) {
      error += std::norm(frf.value[k] - 2.0);
      stated += frf.std_dev[k] * frf.std_dev[k];
    }
  }
  EXPECT_NEAR(
      error / stated, 1.0,
      0.08);  // 5140 exponentially distributed lines: 4 sigma 5.6 %, plus the scatter of the stated one
}

TEST(FrfEstimator, standardDeviationOfASingleHitComesFromTheNoise) {
  // A half-sine hit and a response of noise around twice the force.
  constexpr std::size_t N = 4096;
  const std::vector<double> clean = halfSine(N, 200, 20, 100.0);
  const std::vector<double> window = impactWindow(clean);
  const double share = rms(window) * rms(window);
  double error = 0.0, stated = 0.0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    std::vector<double> force = clean, response = clean;
    const std::vector<double> in = noise(N, 0.5, 2 * seed), out = noise(N, 0.2, 2 * seed + 1);
    for (std::size_t i = 0; i < N; ++i) {
      force[i] = (clean[i] + in[i]) * window[i];
      response[i] = 2.0 * clean[i] + out[i];
    }
    FrfEstimator estimator(51200.0, N);
    estimator.add(force, response);
    EXPECT_TRUE(std::isnan(estimator.h1("1").std_dev[5]));
    estimator.setNoise(0.5, 0.2, share);
    const FrequencyResponse frf = estimator.h1("1").band(100.0, 2000.0);
    EXPECT_TRUE(std::isnan(frf.coherence[0]));
    for (std::size_t k = 0; k < frf.size(); ++k) {
      error += std::norm(frf.value[k] - 2.0);
      stated += frf.std_dev[k] * frf.std_dev[k];
    }
  }
  EXPECT_NEAR(error / stated, 1.0, 0.1);  // 60 hits; the force noise is correlated between neighbouring lines
}

TEST(FrfEstimator, rejectsInvalidHits) {
  FrfEstimator estimator(1000.0, 4);
  EXPECT_THROW(estimator.h1("1"), Error);
  EXPECT_THROW(estimator.add({1, 2, 3}, {1, 2, 3, 4}), Error);
  EXPECT_THROW(estimator.add({1, 2, 3, std::nan("")}, {1, 2, 3, 4}), Error);
  EXPECT_THROW(FrfEstimator(0.0, 4), Error);
}

TEST(FrequencyResponse, bandAndInterpolation) {
  FrequencyResponse frf;
  frf.frequency = {0.0, 1.0, 2.0, 3.0};
  frf.value = {{0.0, 0.0}, {1.0, 2.0}, {3.0, 2.0}, {4.0, 4.0}};
  frf.std_dev = {1.0, 2.0, 3.0, 4.0};
  frf.unit = "1";
  const FrequencyResponse part = frf.band(1.0, 2.0);
  EXPECT_EQ(part.frequency, (std::vector<double>{1.0, 2.0}));
  EXPECT_EQ(part.std_dev, (std::vector<double>{2.0, 3.0}));
  EXPECT_EQ(frf.at(1.25), Complex(1.5, 2.0));
  EXPECT_EQ(frf.at(3.0), Complex(4.0, 4.0));
  EXPECT_THROW(frf.at(3.1), Error);
  const FrequencyResponse receptance = receptanceFromAccelerance(frf);
  EXPECT_EQ(receptance.size(), 3u);
  EXPECT_EQ(receptance.unit, "m/N");
  const double square = std::pow(units::TWO_PI * 2.0, 2);
  EXPECT_NEAR(std::abs(receptance.value[1] - Complex(3.0, 2.0) / -square), 0.0, 1e-16);
  EXPECT_NEAR(receptance.std_dev[1], 3.0 / square, 1e-16);
}

TEST(Statistics, closedForms) {
  EXPECT_DOUBLE_EQ(mean({1.0, 2.0, 6.0}), 3.0);
  EXPECT_DOUBLE_EQ(rms({3.0, -4.0}), std::sqrt(12.5));
  EXPECT_DOUBLE_EQ(standardDeviation({1.0, 2.0, 3.0, 4.0}), std::sqrt(5.0 / 3.0));
  EXPECT_DOUBLE_EQ(median({5.0, 1.0, 3.0}), 3.0);
  EXPECT_DOUBLE_EQ(median({4.0, 1.0, 3.0, 2.0}), 2.5);
  EXPECT_DOUBLE_EQ(percentile({10.0, 0.0, 5.0}, 0.1), 1.0);
  EXPECT_DOUBLE_EQ(percentile({7.0}, 1.0), 7.0);
  // Tables of Student's t.
  EXPECT_NEAR(1.96 * studentOverNormal(5.0), 2.571, 5e-3);
  EXPECT_NEAR(1.96 * studentOverNormal(8.0), 2.306, 2e-3);
  EXPECT_NEAR(1.96 * studentOverNormal(30.0), 2.042, 1e-3);
  EXPECT_EQ(firstNotFinite({1.0, std::numeric_limits<double>::infinity()}), 1u);
  EXPECT_EQ(firstNotFinite({1.0, 2.0}), 2u);
  EXPECT_EQ(longestRunAtExtreme({0.0, 5.0, 5.0, 5.0, 1.0, -2.0, -2.0}), 3u);
  EXPECT_EQ(longestRunAtExtreme({0.0, 5.0, -2.0}), 1u);
  EXPECT_THROW(mean({}), Error);
  EXPECT_THROW(standardDeviation({1.0}), Error);
  EXPECT_THROW(percentile({1.0}, 1.5), Error);
}

// Cubics and quartics, away from the ends.
TEST(SmoothedDerivative, isExactForPolynomials) {
  const double rate = 1000.0;
  std::vector<double> cubic, quartic;
  for (int i = 0; i < 400; ++i) {
    const double t = i / rate;
    cubic.push_back(2.0 - 3.0 * t + 5.0 * t * t - 4.0 * t * t * t);
    quartic.push_back(1.0 + t - 2.0 * t * t + 3.0 * t * t * t + 6.0 * t * t * t * t);
  }
  const std::vector<double> slope = smoothedDerivative(cubic, rate, 1, 5e-3),
                            curvature = smoothedDerivative(quartic, rate, 2, 5e-3);
  for (const int i : {50, 200, 340}) {
    const double t = i / rate;
    EXPECT_NEAR(slope[static_cast<std::size_t>(i)], -3.0 + 10.0 * t - 12.0 * t * t, 1e-9) << i;
    EXPECT_NEAR(curvature[static_cast<std::size_t>(i)], -4.0 + 18.0 * t + 72.0 * t * t, 1e-6) << i;
  }
}

TEST(SmoothedDerivative, attenuatesASineLikeItsWeights) {
  const double rate = 10000.0, smoothing = 4e-3;
  for (const double frequency : {5.0, 20.0, 57.5}) {
    const double w = units::TWO_PI * frequency, u = std::pow(w * smoothing, 2),
                 attenuation = (1.0 + 0.5 * u) * std::exp(-0.5 * u);
    std::vector<double> sine;
    for (int i = 0; i < 8000; ++i) sine.push_back(std::sin(w * i / rate));
    const std::vector<double> slope = smoothedDerivative(sine, rate, 1, smoothing),
                              curvature = smoothedDerivative(sine, rate, 2, smoothing);
    for (const int i : {3000, 4021, 5555}) {
      const auto k = static_cast<std::size_t>(i);
      // The weights are truncated at 4.5 deviations, which changes the response at the highest frequency.
      EXPECT_NEAR(slope[k], attenuation * w * std::cos(w * i / rate), 2.5e-3 * w) << frequency;
      EXPECT_NEAR(curvature[k], -attenuation * w * w * std::sin(w * i / rate), 1e-2 * w * w) << frequency;
    }
  }
}

// A motion that continues beyond the record, and one at rest.
TEST(SmoothedDerivative, tendsToZeroAtTheEnds) {
  std::vector<double> moving(300), resting(300, 7.0);
  for (std::size_t i = 0; i < moving.size(); ++i) moving[i] = 0.02 * static_cast<double>(i);
  for (const double a : smoothedDerivative(moving, 1000.0, 2, 4e-3)) EXPECT_NEAR(a, 0.0, 1e-6);
  for (const double a : smoothedDerivative(resting, 1000.0, 1, 4e-3)) EXPECT_NEAR(a, 0.0, 1e-9);
  EXPECT_NEAR(smoothedDerivative(moving, 1000.0, 1, 4e-3).front(), 0.0, 1e-6);
  EXPECT_EQ(smoothedDerivative({3.0}, 1000.0, 1, 4e-3), std::vector<double>{0.0});
}

}  // namespace
}  // namespace smartmill
