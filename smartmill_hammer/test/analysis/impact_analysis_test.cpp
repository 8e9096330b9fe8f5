#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/modal/hit_check.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/signal/hit_collector.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/analysis/hits_needed.h"
#include "smartmill_hammer/analysis/offset_factor.h"
#include "smartmill_hammer/analysis/tap_records.h"

namespace smartmill::hammer {
namespace {

constexpr double RATE = 25600.0;

/// A half-sine hit on one mode; the response is exact for a force that is linear between samples of 1/8 of
/// the step.
Hit hitOn(const ModalModel& model, double peak, double noise, std::mt19937& random,
          std::size_t samples = 5120) {
  std::normal_distribution<double> normal;
  ModalFilter filter(model, 8 * RATE, Hold::first_order);
  Hit hit;
  hit.sample_rate = RATE;
  hit.pre_trigger = 256;
  const double contact = 0.4e-3;
  for (std::size_t i = 0; i < samples; ++i) {
    double x = 0.0, f = 0.0;
    for (int s = 7; s >= 0; --s) {
      const double t = (static_cast<double>(i) - 256.0 - s / 8.0) / RATE;
      f = t > 0.0 && t < contact ? peak * std::sin(units::PI * t / contact) : 0.0;
      x = filter.step(f);
    }
    hit.force.push_back(f + 3.0 + 0.1 * noise * normal(random));
    hit.response.push_back(x + 1e-6 + 2e-8 * noise * normal(random));
  }
  return hit;
}

ModalModel oneMode() {
  ModalModel m;
  m.modes = {{1200.0, 0.03, 1.0 / 30e6}};
  return m;
}

// A truncated decay, 10 ms before the hit: one second is recorded of time constants 1 / (2 pi f zeta) = 5.3 s
// and 1.3 s, and 151.2 Hz ends a fifth of a cycle off. Reference: the modes themselves; aliasing of the
// sampled pulse is 0.1 % of the gain.
TEST(TapRecords, TruncatedDecayKeepsPolesAndGains) {
  std::mt19937 random(9);
  ModalModel beam;
  beam.modes = {{151.2, 2e-4, 1.3e-6}, {817.3, 1.5e-4, 4e-8}};
  std::vector<TapRecord> taps;
  for (int k = 0; k < 3; ++k)
    taps.push_back(
        {"hit " + std::to_string(k), hitOn(beam, 13.0, 1.0, random, 25600), ResponseKind::displacement});
  const TapFrf frf = averageTaps(taps, {});
  for (const TapVerdict& v : frf.hits) EXPECT_TRUE(v.accepted()) << v.reason;
  EXPECT_GT(frf.truncated_length, 0.98);
  std::vector<EstimatedMode> modes = estimateModes({frf.receptance}, {}).modes;
  correctTruncation(modes, frf.truncated_length);
  ASSERT_EQ(modes.size(), beam.modes.size());
  for (std::size_t k = 0; k < modes.size(); ++k) {
    EXPECT_NEAR(modes[k].frequency, beam.modes[k].frequency, 1e-5 * beam.modes[k].frequency);
    EXPECT_NEAR(modes[k].damping_ratio, beam.modes[k].damping_ratio, 0.02 * beam.modes[k].damping_ratio);
    EXPECT_NEAR(modes[k].gain[0], beam.modes[k].gain, 0.01 * beam.modes[k].gain);
    EXPECT_NEAR(modes[k].phase_part[0], 0.0, 0.01 * beam.modes[k].gain);
  }
}

// Closed form of eq. 4.44, by hand: L = 51, offset 15, l = 36 mm: 2 51^3 / (36^2 (153 - 36)) = 265302 /
// 151632.
TEST(OffsetCorrection, IsTheThesisFactor) {
  EXPECT_NEAR(offsetFactor(51e-3, 15e-3), 265302.0 / 151632.0, 1e-12);
  EXPECT_DOUBLE_EQ(offsetFactor(51e-3, 0.0), 1.0);
  // The cantilever itself: force at l, deflection at L, against force at L.
  const double big_l = 80e-3, l = 65e-3;
  const double cross = l * l * (3 * big_l - l) / 6.0, direct = big_l * big_l * big_l / 3.0;
  EXPECT_NEAR(offsetFactor(big_l, big_l - l), direct / cross, 1e-12);
  EXPECT_THROW(offsetFactor(15e-3, 15e-3), Error);
  EXPECT_THROW(offsetFactor(50e-3, -1e-3), Error);
}

// Aliasing of the sampled half sine is 0.1 % at the mode; the baseline of 3 N and 1 um must not matter.
TEST(ImpactAnalysis, ReproducesTheReceptance) {
  std::mt19937 random(3);
  ImpactAnalysis analysis{ImpactOptions()};
  analysis.add(hitOn(oneMode(), 200.0, 0.0, random));
  const FrequencyResponse h = analysis.frf();
  for (const double f : {200.0, 1000.0, 1200.0, 1300.0, 2000.0}) {
    const auto truth = oneMode().response(f);
    EXPECT_LT(std::abs(h.at(f) - truth), 0.01 * std::abs(truth)) << f;
  }
}

// Against the noise-free hit (sampling a half sine aliases by some tenths of a percent, which no scatter
// contains). Mean of |error|^2 over the stated variance is one; over 40 measurements x 40 independent lines
// it scatters by 4 %.
TEST(ImpactAnalysis, StandardDeviationIsCalibrated) {
  std::mt19937 unused(1);
  ImpactAnalysis clean{ImpactOptions()};
  clean.add(hitOn(oneMode(), 200.0, 0.0, unused));
  const FrequencyResponse exact = clean.frf();
  for (const int hits : {1, 3, 8}) {
    double ratio[3] = {};
    int count = 0;
    for (int run = 0; run < 40; ++run) {
      std::mt19937 random(50u + static_cast<std::uint32_t>(100 * hits + run));
      ImpactAnalysis analysis{ImpactOptions()};
      for (int i = 0; i < hits; ++i) analysis.add(hitOn(oneMode(), 200.0 + 10 * i, 1.0, random));
      for (const FrfAverage average : {FrfAverage::h1, FrfAverage::h2, FrfAverage::hv}) {
        const FrequencyResponse h = analysis.frf(average);
        for (std::size_t k = 160; k < 320; k += 4)  // 800..1600 Hz
          ratio[static_cast<int>(average)] +=
              std::norm(h.value[k] - exact.value[k]) / std::norm(h.std_dev[k]);
      }
      count += 40;
    }
    for (const double sum : ratio) {
      EXPECT_GT(sum / count, 0.7) << hits;
      EXPECT_LT(sum / count, 1.3) << hits;
    }
  }
}

// As many hits as required and no more: the error against the noise-free hit is then the required one.
TEST(HitsNeeded, ReachTheRequiredUncertainty) {
  std::mt19937 unused(1);
  ImpactAnalysis clean{ImpactOptions()};
  clean.add(hitOn(oneMode(), 200.0, 0.0, unused));
  const FrequencyResponse exact = clean.frf();
  const double low = 200.0, high = 2000.0, required = 0.01;
  double squares = 0.0, hits = 0.0;
  constexpr int RUNS = 20;
  for (std::uint32_t run = 0; run < RUNS; ++run) {
    std::mt19937 random(900u + run);
    ImpactAnalysis analysis{ImpactOptions()};
    HitsNeeded needed;
    while (analysis.hits() < 3 || !needed.isReached()) {
      ASSERT_LT(analysis.hits(), 60);
      analysis.add(hitOn(oneMode(), 200.0, 3.0, random));
      if (analysis.hits() > 1) needed = hitsNeeded(analysis.frf(), low, high, required);
    }
    double off = 0.0, all = 0.0;
    const FrequencyResponse h = analysis.frf();
    for (std::size_t k = 0; k < h.size(); ++k) {
      if (h.frequency[k] < low || h.frequency[k] > high) continue;
      off += std::norm(h.value[k] - exact.value[k]);
      all += std::norm(exact.value[k]);
    }
    squares += off / all / RUNS;
    hits += analysis.hits() / static_cast<double>(RUNS);
  }
  EXPECT_GT(hits, 3.5);  // the rule was what ended it
  EXPECT_LT(std::sqrt(squares), 1.15 * required);
  EXPECT_GT(std::sqrt(squares), 0.75 * required);
  EXPECT_THROW(hitsNeeded(exact, 1e6, 2e6, required), Error);
}

// Noise of the force lowers H1, noise of the response raises H2; Hv is between them, |H1| = C |H2|.
TEST(ImpactAnalysis, AveragesAreOrdered) {
  std::mt19937 random(9);
  ImpactAnalysis analysis{ImpactOptions()};
  for (int i = 0; i < 4; ++i) analysis.add(hitOn(oneMode(), 20.0, 5.0, random));
  const FrequencyResponse one = analysis.frf(FrfAverage::h1), two = analysis.frf(FrfAverage::h2),
                          between = analysis.frf(FrfAverage::hv);
  for (std::size_t k = 100; k < 400; k += 7) {
    EXPECT_LE(std::abs(one.value[k]), std::abs(between.value[k]));
    EXPECT_LE(std::abs(between.value[k]), std::abs(two.value[k]));
    EXPECT_NEAR(std::abs(one.value[k]) / std::abs(two.value[k]), one.coherence[k], 1e-12);
    EXPECT_NEAR(std::arg(between.value[k] / one.value[k]), 0.0, 1e-12);
  }
}

TEST(ImpactAnalysis, ExponentialWindowAddsKnownDamping) {
  ModalModel model = oneMode();
  ImpactOptions options;
  options.exponential_time = 0.02;
  std::mt19937 random(3);
  ImpactAnalysis analysis(options);
  analysis.add(hitOn(model, 200.0, 0.0, random));
  ModalModel damped = model;
  damped.modes[0].damping_ratio += 1.0 / (0.02 * units::TWO_PI * 1200.0);
  EXPECT_LT(std::abs(analysis.frf().at(1200.0) - damped.response(1200.0)),
            0.02 * std::abs(damped.response(1200.0)));
  analysis.removeWindowDamping(damped);
  EXPECT_NEAR(damped.modes[0].damping_ratio, 0.03, 1e-12);
}

TEST(HitFaults, AreNamed) {
  std::mt19937 random(4);
  const HitCheckOptions limits{20.0, 0.1, 1.0, 0.0};
  const Hit good = hitOn(oneMode(), 200.0, 0.2, random);
  EXPECT_EQ(hitFault(good, limits).text, "");
  EXPECT_NE(hitFault(hitOn(oneMode(), 10.0, 0.2, random), limits).text.find("weak"), std::string::npos);
  Hit twice = good;
  for (int i = 0; i < 10; ++i) twice.force[800 + i] += 60.0 * std::sin(units::PI * i / 10.0);
  EXPECT_NE(hitFault(twice, limits).text.find("double hit"), std::string::npos);
  EXPECT_FALSE(hitFault(twice, limits).bad_data);
  Hit clipped = good;
  for (double& f : clipped.force) f = std::min(f, 150.0);
  EXPECT_NE(hitFault(clipped, limits).text.find("clipped"), std::string::npos);
  Hit far = good;
  far.response[400] = -1.0;
  EXPECT_TRUE(hitFault(far, limits).bad_data);
  Hit nan = good;
  nan.response[1000] = std::nan("");
  EXPECT_NE(hitFault(nan, limits).text.find("1000"), std::string::npos);
}

TEST(HitCollector, CutsRecordsAndNamesLostSamples) {
  std::mt19937 random(5);
  const Hit hit = hitOn(oneMode(), 200.0, 0.2, random, 10000);
  for (const bool lossy : {false, true}) {
    HitCollector collector({10.0, 0.005, 0.1});
    collector.arm();
    std::optional<HitCollector::Record> record;
    int records = 0;
    for (std::size_t i = 0; i < hit.force.size(); ++i) {
      if (lossy && i == 500) i += 100;
      auto r = collector.add(static_cast<double>(i) / RATE, 77 + i, RATE, hit.force[i], hit.response[i]);
      if (r) {
        record = std::move(r);
        ++records;
      }
    }
    ASSERT_EQ(records, 1);
    EXPECT_EQ(record->hit.force.size(), 2560u);
    EXPECT_EQ(record->hit.pre_trigger, 128u);
    EXPECT_NEAR(record->hit.stamp, 256.5 / RATE, 1.1 / RATE);
    EXPECT_EQ(record->fault.empty(), !lossy) << record->fault;
  }
}

}  // namespace
}  // namespace smartmill::hammer
