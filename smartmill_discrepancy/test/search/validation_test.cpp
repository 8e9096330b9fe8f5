#include "smartmill_discrepancy/search/validation.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "explain/small_campaign.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

using Random = std::mt19937_64;

/// A change by lines at orders 1..8 of a spindle, and a residual of unit noise and lines of random phase at
/// the same orders.
struct Drawn {
  std::vector<double> change, residual;

  Drawn(double change_size, double residual_size, std::size_t samples, Random& random) {
    std::uniform_real_distribution<double> phase(0.0, units::TWO_PI);
    std::normal_distribution<double> noise;
    change.resize(samples);
    for (std::size_t i = 0; i < samples; ++i) residual.push_back(noise(random));
    const double step = 0.0137 + 1e-3 * phase(random);  // [rad] per sample
    for (int order = 1; order <= 8; ++order) {
      const double a = phase(random), b = phase(random);
      for (std::size_t i = 0; i < samples; ++i) {
        const double at = order * step * static_cast<double>(i);
        change[i] += change_size / order * std::sin(at + a);
        residual[i] += residual_size / order * std::sin(at + b);
      }
    }
  }
  ScaleEvidence evidence() const {
    ScaleEvidence test;
    test.add(change.data(), residual.data(), residual.size());
    return test;
  }
};

// |r + d|^2 - |r|^2 = |d|^2 (2 a - 1), by hand.
TEST(EffectScale, ExceedsHalfIfTheGapShrinks) {
  Random random(1);
  for (const double residual_size : {0.0, 1.0, 5.0}) {
    const Drawn drawn(2.0, residual_size, 4000, random);
    double without = 0.0, with = 0.0, squares = 0.0;
    for (std::size_t i = 0; i < drawn.residual.size(); ++i) {
      without += std::pow(drawn.residual[i] + drawn.change[i], 2);
      with += std::pow(drawn.residual[i], 2);
      squares += std::pow(drawn.change[i], 2);
    }
    const EffectScale evidence = effectScaleOf({drawn.evidence()});
    EXPECT_NEAR(squares * (2.0 * evidence.scale - 1.0), without - with, 1e-9 * without);
  }
}

// The scale of correct models is 1 with calibrated deviations, in noise alone and with lines of another cause
// at the same orders.
TEST(EffectScale, DeviationsAreCalibrated) {
  for (const double residual_size : {0.0, 0.3, 3.0}) {
    Random random(2);
    Coverage coverage;
    for (int k = 0; k < Coverage::RUNS; ++k) {
      const EffectScale evidence = effectScaleOf({Drawn(0.5, residual_size, 3000, random).evidence()});
      coverage.add(evidence.scale - 1.0, evidence.std_dev);
    }
    EXPECT_TRUE(coverage.isCalibrated()) << residual_size;
  }
}

// A change that imitates another cause reduces the residual of fitted tests; independent tests prefer a scale
// of zero.
TEST(EffectScale, RejectsAnImitation) {
  Random random(3);
  int rejected = 0;
  for (int k = 0; k < 100; ++k) {
    std::vector<ScaleEvidence> tests;
    for (int t = 0; t < 3; ++t) {
      Drawn drawn(0.5, 2.0, 3000, random);
      for (std::size_t i = 0; i < drawn.residual.size(); ++i) drawn.residual[i] -= drawn.change[i];
      tests.push_back(drawn.evidence());
    }
    const EffectScale evidence = effectScaleOf(tests);
    rejected += evidence.margin() < 2.0;
  }
  EXPECT_GE(rejected, 95);
}

// Rejection during the search and acceptance are symmetric about a scale of one half.
TEST(ValidationResult, UncertainTestsDoNotReject) {
  EXPECT_TRUE(ValidationResult::isRejected({-0.4, 0.55}));
  EXPECT_FALSE(ValidationResult::isRejected({0.2, 0.58}));
  EXPECT_FALSE(ValidationResult::isRejected(effectScaleOf({})));
  for (double share = -1.0; share < 2.0; share += 0.1)
    EXPECT_FALSE(ValidationResult::isRejected({share, 0.2}) &&
                 ValidationResult({{share, 0.2}, {1.0, 0.01}}).isAccepted());
}

TEST(EffectScale, IsUnknownWithoutEvidence) {
  const EffectScale evidence = effectScaleOf({});
  EXPECT_EQ(evidence.margin(), 0.0);
  EXPECT_NEAR((EffectScale{1.8, 0.1}.margin()), -3.0, 1e-12);           // of another size
  EXPECT_TRUE((ValidationResult{evidence, {1.0, 0.01}}.isAccepted()));  // by the fitted tests alone
  EXPECT_FALSE((ValidationResult{evidence, {1.0, 0.2}}.isAccepted()));
  EXPECT_TRUE((ValidationResult{{0.9, 0.3}, {1.0, 0.01}}.isAccepted()));
  EXPECT_FALSE((ValidationResult{{0.9, 0.45}, {1.0, 0.01}}.isAccepted()));
  EXPECT_NEAR((ValidationResult{{0.9, 0.2}, {1.0, 0.01}}.confidence()), 0.97725, 1e-5);
}

Record withoutAngle(const CampaignTest& test, std::uint64_t seed) {
  sim::SimulationOptions options;
  options.seed = seed;
  const Record with_angle = sim::simulateTest(believed(), test, 0.2, options);
  Record record;
  record.time = with_angle.time;
  for (const char* name : {"fx", "fy", "fz"}) record.add(name) = with_angle.column(name);
  return record;
}

// The machine equals the model; the spindle angle is not measured.
struct WithoutAngle {
  const TemporaryFolder folder;
  const Dataset data = datasetOf(withoutAngle, folder.file("."));
  Workbench bench{data, WorkbenchOptions{1, 1, 8, {}}};

  FitState stated() const {
    FitState state;
    state.nominal.assign(bench.freedom().coordinates().size(), 0.0);
    return state;
  }
};

// The state with all records rotated.
FitState realigned(const Workbench& bench, const FitState& state, double by) {
  FitState moved = state;
  moved.alignment.resize(bench.quick().alignment().size(), 0.0);
  for (std::size_t k = 0; k < moved.alignment.size(); ++k) {
    if (bench.quick().alignment()[k].freedom.value == &RecordAlignment::phase) moved.alignment[k] += by;
  }
  return moved;
}

// Estimates from lines alone differ slightly from those of a fit; correcting them each time would prevent
// convergence.
TEST(Workbench, LeavesSmallRotationsToTheFits) {
  WithoutAngle records;
  Workbench& bench = records.bench;
  FitState right = records.stated();
  const FitState near = realigned(bench, right, 0.02);
  FitState same = near;
  EXPECT_EQ(bench.alignment().alignPhases(same), 0.0);
  EXPECT_EQ(same, near);
  FitState far = realigned(bench, right, 0.2);
  EXPECT_GT(bench.alignment().alignPhases(far), 0.15);
  // The teeth of this tool are interchangeable.
  const double tooth = units::TWO_PI / believed().tool->teeth;
  for (std::size_t k = 0; k < far.alignment.size(); ++k) {
    if (bench.quick().alignment()[k].freedom.value != &RecordAlignment::phase) continue;
    EXPECT_NEAR(std::remainder(far.alignment[k], tooth), 0.0, 0.02);
  }
}

// Records without angle are aligned by each model: a model with another alignment is evaluated there.
TEST(ValidationResult, UsesTheAlignmentOfEachModel) {
  WithoutAngle records;
  Workbench& bench = records.bench;
  FitState right = records.stated();
  bench.alignment().alignPhases(right);
  bench.alignment().alignTo(right);
  const FitState off = realigned(bench, right, 0.1);
  const EffectScale evidence = validate(bench, right, off).fitted;
  EXPECT_NEAR(evidence.scale, 1.0, 0.1);
  EXPECT_LT(evidence.std_dev, 0.05);
  // A model does not differ from itself.
  EXPECT_TRUE(std::isinf(validate(bench, right, right).fitted.std_dev));
}

}  // namespace
}  // namespace smartmill::discrepancy
