#include "smartmill_core/modal/modal_fit.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "modal/modal_residuals.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/derivative_check.h"

namespace smartmill {
namespace {

ModalModel sensor() {
  ModalModel model;
  model.modes = {{930.0, 0.03, 0.7}, {1950.0, 0.02, 0.2}};
  model.direct = 0.1;
  return model;
}

// Lines 5 Hz apart with circular noise of the given total standard deviation.
FrequencyResponse measured(const ModalModel& model, double std_dev, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto part = [&] { return std_dev / std::sqrt(2.0) * normal(random); };
  FrequencyResponse frf;
  for (double f = 5.0; f <= 4000.0; f += 5.0) {
    frf.frequency.push_back(f);
    frf.value.push_back(model.response(f));
    if (std_dev > 0.0) {
      frf.value.back() += std::complex<double>(part(), part());
      frf.std_dev.push_back(std_dev);
    }
  }
  return frf;
}

TEST(ModalFit, recoversAnExactModel) {
  ModalFitOptions options;
  options.low = 100.0;
  options.high = 4000.0;
  options.modes = 2;
  const ModalFit fit = fitModes(measured(sensor(), 0.0, 1), options);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_NEAR(fit.model.modes[k].frequency / sensor().modes[k].frequency, 1.0, 1e-8);
    EXPECT_NEAR(fit.model.modes[k].damping_ratio / sensor().modes[k].damping_ratio, 1.0, 1e-6);
    EXPECT_NEAR(fit.model.modes[k].gain / sensor().modes[k].gain, 1.0, 1e-6);
  }
  EXPECT_NEAR(fit.model.direct, 0.1, 1e-7);
  EXPECT_LT(fit.relative_error, 1e-7);
}

// A mode with negative gain (hit and response at different points) is omitted with positive_gains.
TEST(ModalFit, keepsGainsPositiveAtADrivePoint) {
  ModalModel cross = sensor();
  cross.modes.push_back({3000.0, 0.02, -0.1});
  ModalFitOptions options;
  options.low = 100.0;
  options.high = 4000.0;
  options.modes = 3;
  EXPECT_NEAR(fitModes(measured(cross, 0.0, 1), options).model.modes[2].gain, -0.1, 1e-6);
  options.positive_gains = true;
  for (const Mode& mode : fitModes(measured(cross, 0.0, 1), options).model.modes) EXPECT_GE(mode.gain, 0.0);
}

TEST(ModalFit, choosesTheNumberOfModesByEvidence) {
  ModalFitOptions options;
  options.low = 100.0;
  options.high = 4000.0;
  options.unit_static_gain = true;
  const ModalFit fit = fitModes(measured(sensor(), 0.05, 3), options);
  ASSERT_EQ(fit.model.modes.size(), 2u);
  EXPECT_NEAR(fit.model.staticGain(), 1.0, 1e-12);
}

TEST(ModalFit, standardDeviationsAreCalibrated) {
  ModalFitOptions options;
  options.low = 100.0;
  options.high = 4000.0;
  options.modes = 2;
  options.unit_static_gain = true;
  const ModalModel truth = sensor();
  double squares = 0.0;
  int count = 0;
  for (unsigned seed = 1; seed <= 100; ++seed) {
    const ModalFit fit = fitModes(measured(truth, 0.05, seed), options);
    for (std::size_t k = 0; k < 2; ++k) {
      const Mode& found = fit.model.modes[k];
      const Mode& expected = truth.modes[k];
      squares += std::pow((found.frequency - expected.frequency) / found.frequency_std, 2) +
                 std::pow((found.damping_ratio - expected.damping_ratio) / found.damping_ratio_std, 2) +
                 std::pow((found.gain - expected.gain) / found.gain_std, 2);
      count += 3;
    }
  }
  // Mean square of 600 z-scores, about 300 of them independent: 1 within four of its standard deviations
  // sqrt(2 / 300).
  EXPECT_NEAR(squares / count, 1.0, 0.33);
}

TEST(ModalFit, separatesCloseModes) {
  ModalModel close;
  close.modes = {{1000.0, 0.02, 1e-8}, {1060.0, 0.02, 2e-8}};
  ModalFitOptions options;
  options.low = 500.0;
  options.high = 2000.0;
  options.modes = 2;
  const ModalFit fit = fitModes(measured(close, 0.0, 1), options);
  EXPECT_NEAR(fit.model.modes[0].frequency, 1000.0, 0.01);
  EXPECT_NEAR(fit.model.modes[1].frequency, 1060.0, 0.01);
  EXPECT_NEAR(fit.model.modes[1].gain / 2e-8, 1.0, 1e-4);
}

TEST(ModalFit, rejectsInvalidInput) {
  ModalFitOptions options;
  options.low = 100.0;
  options.high = 110.0;
  options.modes = 2;
  EXPECT_THROW(fitModes(measured(sensor(), 0.0, 1), options), Error);
  FrequencyResponse bad = measured(sensor(), 0.0, 1);
  bad.value[100] = std::nan("");
  options.high = 4000.0;
  EXPECT_THROW(fitModes(bad, options), Error);
}

// A strong mode above the band has a curved residual inside: at the band's end 1.6 times its static value.
TEST(ModalFit, aStrongModeAboveTheBandDoesNotBiasTheOthers) {
  ModalModel tool;
  tool.modes = {{900.0, 0.03, 0.1}, {2000.0, 0.02, 0.05}, {6500.0, 0.02, 1.0}};
  ModalFitOptions options;
  options.low = 100.0;
  options.high = 4000.0;
  const ModalFit fit = fitModes(measured(tool, 0.0, 1), options);
  ASSERT_EQ(fit.model.modes.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    // The remaining error is from its damping, which the frequency-dependent direct share neglects.
    EXPECT_NEAR(fit.model.modes[k].damping_ratio / tool.modes[k].damping_ratio, 1.0, 0.03);
    EXPECT_NEAR(fit.model.modes[k].gain / tool.modes[k].gain, 1.0, 0.03);
  }
  EXPECT_NEAR(fit.model.direct, 1.0, 0.02);
}

TEST(ModalFit, derivativesAgreeWithDifferences) {
  const FrequencyResponse frf = measured(sensor(), 0.05, 1);
  ModalLines lines;
  lines.frequency = frf.frequency;
  lines.value = frf.value;
  lines.weight.assign(frf.size(), 20.0);
  lines.scale = 3.0;
  lines.low = 100.0;
  for (const bool unit_static_gain : {false, true}) {
    lines.unit_static_gain = unit_static_gain;
    lines.direct = !unit_static_gain;
    Eigen::VectorXd at(lines.parameters(2));
    at.head(6) << std::log(900.0), std::log(0.04), 0.3, std::log(2000.0), std::log(0.01), -0.1;
    at.tail(at.size() - 6).setConstant(0.05);
    if (lines.direct) at[7] = 0.4;
    const fit::DerivativeGap gap = fit::checkDerivatives(ModalResiduals(lines, 2), at);
    EXPECT_LT(gap.relative, 1e-8) << gap.row << " " << gap.column << " " << gap.given << " " << gap.numeric;
  }
}

}  // namespace
}  // namespace smartmill
