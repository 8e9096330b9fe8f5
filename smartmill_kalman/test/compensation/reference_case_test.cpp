#include "smartmill_kalman_testing/reference_case.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/campaign_compensation.h"
#include "smartmill_kalman/compensation/record_compensation.h"
#include "smartmill_kalman/filter/inverse_filter.h"

namespace smartmill::kalman {
namespace {

ReferenceCase reference(double rpm, double duration = 0.5) {
  ReferenceCase result;
  result.spindle_speed = units::radPerSecFromRpm(rpm);
  result.duration = duration;
  return result;
}

/// Issue's figures: 0.6 % to 3 kHz and 1.2 % to 5 kHz causal, 0.5 and 1.0 % smoothed, 1.2 and 2.2 % inverse;
/// 1 % between the third and the eighth revolution after entry.
class ReferenceTargets : public testing::TestWithParam<double> {};

TEST_P(ReferenceTargets, AreMet) {
  const ReferenceCase c = reference(GetParam());
  const ReferenceRecord record = simulate(c);
  const double revolution = 60.0 / GetParam();
  const auto sample = [&](double t) { return static_cast<std::size_t>(t * c.sample_rate); };
  const std::size_t from = sample(c.engage_time + 0.1), to = record.time.size();
  const std::size_t third = sample(c.engage_time + 2.0 * revolution);
  const std::size_t eighth = sample(c.engage_time + 8.0 * revolution);
  HarmonicFilter filter(c.sensor, c.spindle_speed, c.sample_rate, HarmonicFilterParameters());
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto error = [&](const std::vector<double>& force, std::size_t a, std::size_t b, double band) {
      return bandError(force, record.truth[axis], c.sample_rate, a, b, band);
    };
    std::vector<double> causal;
    filter.reset();
    for (const double measured : record.measured[axis]) causal.push_back(filter.step(measured));
    EXPECT_LT(error(causal, from, to, 3000.0), 0.006);
    EXPECT_LT(error(causal, from, to, 5000.0), 0.012);
    EXPECT_LT(error(causal, third, eighth, 3000.0), 0.01);
    EXPECT_LT(error(causal, third, eighth, 5000.0), 0.01);
    const auto inverse = compensateRecord(Method::inverse, record.measured[axis], c.sensor, c.spindle_speed,
                                          c.sample_rate, HarmonicFilterParameters());
    EXPECT_LT(error(inverse, from, to, 3000.0), 0.012);
    EXPECT_LT(error(inverse, from, to, 5000.0), 0.022);
  }
  // The smoother once: two more layouts take their time.
  const auto smoothed = compensateRecord(Method::smoother, record.measured[1], c.sensor, c.spindle_speed,
                                         c.sample_rate, HarmonicFilterParameters());
  EXPECT_LT(bandError(smoothed, record.truth[1], c.sample_rate, from, to, 3000.0), 0.005);
  EXPECT_LT(bandError(smoothed, record.truth[1], c.sample_rate, from, to, 5000.0), 0.010);
}

INSTANTIATE_TEST_SUITE_P(Speeds, ReferenceTargets, testing::Values(3000.0, 9000.0, 15000.0, 21750.0));

TEST(Reference, NineTapsServeAsWellAsTheTruth) {
  const ReferenceCase c = reference(21750.0);
  const ReferenceTaps taps = simulateTaps(c, 9);
  const ModalFit fit = identifySensor(taps.hammer, taps.response, c.sample_rate, {100.0, 5000.0, 4});
  ASSERT_EQ(fit.model.modes.size(), 3u);
  const ReferenceRecord record = simulate(c);
  const auto force = compensateRecord(Method::kalman, record.measured[0], fit.model, c.spindle_speed,
                                      c.sample_rate, HarmonicFilterParameters());
  EXPECT_LT(bandError(force, record.truth[0], c.sample_rate, 3072, force.size(), 5000.0), 0.015);
}

// A sine inside the band comes out as it went in, latency samples late, whatever the blocks.
TEST(InverseFilter, RestoresASineInBlocksOfAnyLength) {
  const ModalModel sensor = ReferenceCase::exactSensor();
  InverseParameters parameters;
  parameters.noise_share = parameters.uncertainty = 0.0;
  InverseFilter filter(sensor, 25600.0, parameters);
  std::vector<double> applied, measured;
  for (int i = 0; i < 12000; ++i) {
    const auto wave = std::polar(100.0, units::TWO_PI * 1450.0 * i / 25600.0);
    applied.push_back(wave.real());
    measured.push_back((sensor.response(1450.0) * wave).real());
  }
  std::vector<double> found;
  for (std::size_t at = 0, block = 100; at < measured.size(); at += block, block = block == 100 ? 257 : 100) {
    const auto end = std::min(at + block, measured.size());
    const auto part = filter.process({measured.begin() + static_cast<std::ptrdiff_t>(at),
                                      measured.begin() + static_cast<std::ptrdiff_t>(end)});
    found.insert(found.end(), part.begin(), part.end());
  }
  ASSERT_EQ(found.size(), measured.size());
  for (std::size_t i = 6000; i < found.size(); ++i) {
    ASSERT_NEAR(found[i], applied[i - filter.latency()], 0.1);  // what rings beyond the taps: 1e-3
  }
}

}  // namespace
}  // namespace smartmill::kalman
