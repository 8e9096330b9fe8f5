#include "kalman/tuning.h"

#include <cmath>
#include <complex>
#include <cstdio>
#include <filesystem>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/campaign_compensation.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0;  // [Hz]

const ReferenceTaps& taps() {
  static const ReferenceTaps result = simulateTaps(ReferenceCase(), 9);
  return result;
}

const ModalModel& tapped() {
  static const ModalModel result =
      identifySensor(taps().hammer, taps().response, RATE, {100.0, 5000.0, 4}).model;
  return result;
}

// For an ideal sensor the random-walk filter is exponential smoothing with a gain in closed form:
// p^2 = q dt (p + r), K = p / (p + r).
TEST(Tuning, RandomWalkIsExponentialSmoothing) {
  ModalModel ideal;
  ideal.direct = 1.0;
  const double q = std::pow(2.0, 14), r = 4.0, per_sample = q / RATE;
  const double p = 0.5 * (per_sample + std::sqrt(per_sample * per_sample + 4.0 * per_sample * r));
  const std::vector<double> force = randomWalkForce(std::vector<double>(50, 1.0), ideal, RATE, q, r);
  for (std::size_t k = 0; k < force.size(); ++k)
    EXPECT_NEAR(force[k], 1.0 - std::pow(r / (p + r), static_cast<double>(k) + 1.0), 1e-6) << k;
}

TEST(Tuning, NoiseIsToldFromBeforeTheBlows) {
  // 9 taps of 230 samples of 1 N: the standard deviation of the variance is 1 / sqrt(1035) = 3.1 %.
  EXPECT_NEAR(noiseBefore(taps(), RATE, 0.009), 1.0, 0.1);
  EXPECT_THROW(noiseBefore({{{0.0, 1.0}}, {{0.0, 0.0}}}, RATE, 1.0 / RATE), Error);
}

TEST(Tuning, PlantsLieAtTheEdgeOfTheConfidenceInterval) {
  FrequencyResponse frf = averagedFrf(taps().hammer, taps().response, RATE);
  for (std::size_t i = 0; i < frf.size(); ++i) frf.std_dev[i] = 0.01 * std::abs(frf.value[i]);
  const auto before = fourier(taps().response[2]),
             after = fourier(plantAt(taps(), frf, RATE, -3.0).response[2]);
  for (const std::size_t line : {20u, 290u, 700u})
    EXPECT_LT(std::abs(after[line] / before[line] - std::polar(0.97, -0.03)), 1e-9);
}

// The optimum of the map of the taps is within 2^1 .. 2^30, and gives errors of the tooth harmonics of at
// most 5 % (Burzoni: 10 .. 30 %).
TEST(Tuning, QOfTheTapsServesTheCut) {
  std::vector<double> speeds;
  for (const double rpm : {1000.0, 3700.0, 9300.0, 17600.0}) speeds.push_back(units::radPerSecFromRpm(rpm));
  const TuningMap map = tapMap(taps(), tapped(), RATE, noiseBefore(taps(), RATE, 0.009), speeds, 5000.0);
  for (const double rpm : {9300.0, 17600.0}) {
    ReferenceCase reference;
    reference.spindle_speed = units::radPerSecFromRpm(rpm);
    reference.duration = 0.6;
    const ReferenceRecord record = simulate(reference);
    const int exponent = map.best(reference.spindle_speed);
    EXPECT_GT(exponent, LEAST_EXPONENT);
    EXPECT_LT(exponent, MOST_EXPONENT);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const auto force = randomWalkForce(record.measured[axis], tapped(), RATE, std::pow(2.0, exponent), 1.0);
      const CutScore score =
          scoreCut(force, record.truth[axis], RATE, reference.spindle_speed, 4, 5120, 5000.0, 3000.0);
      EXPECT_LT(score.amplitude, 0.05) << rpm << " " << axis;
      const CutScore raw = scoreCut(record.measured[axis], record.truth[axis], RATE, reference.spindle_speed,
                                    4, 5120, 5000.0, 3000.0);
      EXPECT_LT(score.rmse, 0.2 * raw.rmse) << rpm << " " << axis;
    }
  }
}

// By the likelihood alone, varying amplitudes get a short memory and constant ones a long one, each in its
// band.
TEST(Tuning, LikelihoodTellsEachBandsMemory) {
  ModalModel ideal;
  ideal.direct = 1.0;
  const double speed = units::TWO_PI * 200.0;
  FrequencyResponse frf;
  for (double f = 0.0; f <= 6000.0; f += 5.0) {
    frf.frequency.push_back(f);
    frf.value.emplace_back(1.0);
    frf.std_dev.push_back(0.001);
  }
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0.0, 1.0);
  std::vector<double> measured;
  double wandering = 50.0;
  for (int i = 0; i < 20000; ++i) {
    const double angle = speed * i / RATE;
    wandering += 0.02 * noise(random);  // of the third harmonic, 600 Hz: tau = 50 samples, 0.4 revolutions
    measured.push_back(wandering * std::cos(3.0 * angle) + 50.0 * std::cos(10.0 * angle) + noise(random));
  }
  const BandTuning tuned = tuneBands(measured, ideal, speed, RATE, 1.0, {1000.0}, frf, 20);
  ASSERT_EQ(tuned.memory.size(), 2u);
  EXPECT_LE(tuned.memory[0], 1.0);
  EXPECT_GE(tuned.memory[1], 4.0);
}

TEST(Tuning, DrawsTheMap) {
  TuningMap map;
  map.speed = {100.0, 200.0, 300.0};
  for (int n = LEAST_EXPONENT; n <= MOST_EXPONENT; ++n)
    map.rmse.push_back({1.0 + std::abs(n - 12), 1.0 + std::abs(n - 14), 1.0 + std::abs(n - 16)});
  EXPECT_EQ(map.best(190.0), 14);
  const std::string png = (std::filesystem::temp_directory_path() / "smartmill_tuning_test.png").string();
  drawMaps({{"a", map, {{200.0, 15}}}, {"b", map, {}}}, png);
  EXPECT_GT(std::filesystem::file_size(png), 1000u);
  std::filesystem::remove(png);
}

}  // namespace
}  // namespace smartmill::kalman
