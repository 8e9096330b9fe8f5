#include "smartmill_loadmeter/motor/motor_current.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;

double rmsOf(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

TEST(Wavelets, aPolynomialOfDegreeFourHasNoDetail) {
  // Five vanishing moments: such a signal is its own approximation away from the ends.
  std::vector<double> signal;
  for (int i = 0; i < 2000; ++i) {
    const double t = i / 2000.0;
    signal.push_back(1.0 + 2.0 * t - 3.0 * t * t + 0.5 * t * t * t - t * t * t * t);
  }
  const std::vector<double> smooth = denoise(signal, 4);
  for (std::size_t i = 300; i < 1700; ++i) ASSERT_NEAR(smooth[i], signal[i], 1e-9) << i;
  EXPECT_EQ(denoise(signal, 0), signal);
  EXPECT_THAT(errorOf([] { denoise({1.0, 2.0, 3.0}, 6); }), HasSubstr("3 samples are too few for level 6"));
}

TEST(Wavelets, removeNoiseAndKeepTheSlowSignal) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> clean, noisy;
  for (int i = 0; i < 3000; ++i) {
    clean.push_back(2.0 + std::sin(units::TWO_PI * 1.0 * i / 1000.0));
    noisy.push_back(clean.back() + 0.5 * normal(random));
  }
  const double left = rmsOf(denoise(noisy, 6), clean);
  // One of 64 coefficients keeps its noise: 0.5 / 8; the mirrored ends add a little.
  EXPECT_LT(left, 1.3 * 0.5 / 8.0);
  EXPECT_GT(left, 0.7 * 0.5 / 8.0);
}

TEST(PhaseRange, isTwiceTheAmplitudeThroughHarmonicsAndNoise) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  for (const double frequency : {3.0, 16.0, 60.0}) {
    std::vector<double> current;
    for (int i = 0; i < 2048; ++i) {
      const double p = units::TWO_PI * frequency * i / 1000.0;
      current.push_back(0.2 + 1.25 * (std::sin(p + 0.4) + 0.08 * std::sin(5 * p) + 0.05 * std::sin(7 * p)) +
                        0.1 * normal(random));
    }
    EXPECT_NEAR(phaseRange(current, 1000.0, frequency), 2.5, 0.02) << frequency;
    EXPECT_NEAR(phaseRange(current, 1000.0, frequency * 1.005), 2.5, 0.03) << "slip at " << frequency;
  }
  EXPECT_THAT(errorOf([] { phaseRange(std::vector<double>(100, 0.0), 1000.0, 3.0); }),
              HasSubstr("less than two periods"));
}

TEST(TorqueLaw, findsTheLawBelowAndAboveBaseSpeed) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  std::vector<SpindleCut> cuts;
  const auto law = [](double n, double rise) {
    const double a = n <= 1570 ? 7.5 - 0.001 * (n - 800) : 6.5 - 0.0015 * (n - 1570);
    const double b = n <= 1570 ? 1.1 : 1.15;
    return a * std::pow(rise, b);
  };
  for (int i = 0; i < 100; ++i) {
    const double n =
        std::array<double, 7>{800, 1000, 1200, 1500, 1800, 2100, 2400}[static_cast<std::size_t>(i % 7)];
    const double rise = 0.5 + 4.0 * uniform(random);
    cuts.push_back({n, rise, law(n, rise) + 0.3 * normal(random)});
  }
  const TorquePowerLaw found(cuts, 1570.0);
  EXPECT_NEAR(found.scatter(), 0.3, 0.08);
  EXPECT_GT(found.rSquared(), 0.99);
  for (const double n : {900.0, 1400.0, 1700.0, 2300.0})
    EXPECT_NEAR(found.torque(n, 2.5), law(n, 2.5), 0.5) << n;
  const std::vector<SpindleCut> slow(cuts.begin(), cuts.begin() + 4);
  EXPECT_THAT(errorOf([&] { TorquePowerLaw(slow, 1570.0).torque(100.0, 1.0); }),
              HasSubstr("rpm, torque at 100 rpm is unknown"));
  EXPECT_THAT(errorOf([&] { TorquePowerLaw(slow, 1570.0).torque(2000.0, 1.0); }),
              HasSubstr("no cut above base speed"));
}

}  // namespace
}  // namespace smartmill::loadmeter
