// Wear by tangential coefficients alone, and by all of them.
#include "smartmill_program/tool/wear_estimate.h"

#include <cmath>
#include <cstdio>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::MM;
using units::PI;

constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();
const CuttingCoefficients SHARP{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};
/// Slot, up-milling, down-milling, a third of the diameter, both sides of the middle.
const std::vector<Engagement> ENGAGEMENTS{{0.0, PI, 2.0 * MM, 0.1 * MM},
                                          {0.0, PI / 2.0, 2.0 * MM, 0.1 * MM},
                                          {PI / 2.0, PI, 2.0 * MM, 0.1 * MM},
                                          {0.0, 1.23, 2.0 * MM, 0.05 * MM},
                                          {0.8, 2.8, 2.0 * MM, 0.2 * MM}};

CuttingCoefficients tangentialOf(CuttingCoefficients k) {
  k.krc = k.kac = k.kre = k.kae = UNKNOWN;
  return k;
}

CuttingCondition cut(const Engagement& engagement) {
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::cut;
  condition.tool_name = "mill";
  condition.tool = {4, 10.0 * MM, 0.0, {}};
  condition.engagement = engagement;
  condition.steady_to = {0.0, 1.0, 0.0};  // along y
  return condition;
}

/// Wear by the mean force of a machine whose axes have these gains.
CutWear wearOf(const CuttingCoefficients& sharp, const CuttingCoefficients& std_dev,
               const CuttingCoefficients& actual, const Engagement& engagement, double gain_x = 1.0,
               double gain_y = 1.0) {
  WearEstimate estimate{WearParameters()};
  const CuttingCondition condition = cut(engagement);
  estimate.begin(condition, SharpCoefficients{sharp, std_dev, ""});
  const CuttingForce mean = MechanisticForce(condition.tool, actual, engagement).mean();
  for (int i = 0; i < 10; ++i) estimate.add(0.02 * i, {-mean.fy * gain_x, mean.fx * gain_y});
  return estimate.present().value_or(CutWear());
}

TEST(WearEstimate, ATangentialForceIsSeparatedInASlot) {
  CuttingCoefficients worn = SHARP;
  worn.kte *= 1.5;
  worn.kre *= 1.8;  // the radial force does not change the result
  worn.krc *= 1.3;
  const Engagement& slot = ENGAGEMENTS[0];
  const CutWear wear = wearOf(tangentialOf(SHARP), {}, worn, slot);
  // Mean over the arc: chip pi / 4 of the feed per tooth, edge 2 / pi.
  const double chip = SHARP.ktc * slot.feed_per_tooth * PI / 4.0, edge = SHARP.kte;
  EXPECT_NEAR(wear.wear, 0.5 * edge * 2.0 / (2.0 * chip + 2.0 * edge), 1e-12);
  EXPECT_EQ(wear.revolutions, 10u);
  EXPECT_NEAR(wearOf(tangentialOf(SHARP), {}, SHARP, slot).wear, 0.0, 1e-12);
}

TEST(WearEstimate, TheUnknownRadialDirectionIsInTheDeviation) {
  for (const Engagement& engagement : ENGAGEMENTS) {
    const CutWear partly = wearOf(tangentialOf(SHARP), {}, SHARP, engagement),
                  wholly = wearOf(SHARP, {}, SHARP, engagement);
    EXPECT_NEAR(wholly.wear, 0.0, 1e-12);
    EXPECT_NEAR(wholly.wear_std, WearParameters().force_error, 1e-12);
    EXPECT_LT(std::abs(partly.wear), 2.0 * partly.wear_std) << engagement.entry << " " << engagement.exit;
    EXPECT_GE(partly.wear_std, wholly.wear_std);
    EXPECT_LT(partly.wear_std, 0.06);
  }
  // A stated deviation of the coefficients is part of it.
  CuttingCoefficients std_dev = SHARP;
  std_dev.ktc *= 0.1;
  std_dev.kte *= 0.1;
  EXPECT_GT(wearOf(tangentialOf(SHARP), std_dev, SHARP, ENGAGEMENTS[0]).wear_std, 0.05);
}

// Machines with drawn coefficients, gains of the axes (1 %) and errors of the identified coefficients: the
// error over the standard deviation. Limits: 1 of 400 draws within 4 sigma, i.e. 0.14; below it the direction
// of the radial force is assumed to be uniform between those of chip and edge, of which these draws cover a
// part.
TEST(WearEstimate, TheStandardDeviationCoversTheError) {
  std::mt19937_64 engine(7);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const auto between = [&](double low, double high) { return low + (high - low) * uniform(engine); };
  for (const bool all : {false, true}) {
    for (const Engagement& engagement : ENGAGEMENTS) {
      double squares = 0.0;
      constexpr int DRAWS = 400;
      for (int i = 0; i < DRAWS; ++i) {
        CuttingCoefficients actual = SHARP;
        actual.ktc = between(600e6, 2000e6);
        actual.kte = between(10e3, 50e3);
        actual.krc = actual.ktc * between(0.1, 0.5);
        actual.kre = actual.kte * between(0.5, 1.5);
        CuttingCoefficients sharp = actual, std_dev = actual;
        const auto err = [&](double CuttingCoefficients::*k, double relative) {
          std_dev.*k = relative * actual.*k;
          sharp.*k += normal(engine) * std_dev.*k;
        };
        err(&CuttingCoefficients::ktc, 0.01);
        err(&CuttingCoefficients::kte, 0.04);
        err(&CuttingCoefficients::krc, 0.02);
        err(&CuttingCoefficients::kre, 0.05);
        const double gain = 1.0 + 0.01 * normal(engine);
        const CutWear wear = wearOf(all ? sharp : tangentialOf(sharp), std_dev, actual, engagement, gain,
                                    all ? gain : 1.0 + 0.01 * normal(engine));
        squares += std::pow(wear.wear / wear.wear_std, 2) / DRAWS;
      }
      const double rms = std::sqrt(squares);
      std::printf("%s, %.2f to %.2f rad: error over standard deviation %.2f\n", all ? "all" : "tangential",
                  engagement.entry, engagement.exit, rms);
      EXPECT_LT(rms, 1.14);
      EXPECT_GT(rms, all || engagement.exit - engagement.entry > 3.0 ? 0.86 : 0.6);
    }
  }
}

TEST(WearEstimate, NoneWithoutTangentialCoefficients) {
  CuttingCoefficients sharp = SHARP;
  sharp.kte = UNKNOWN;
  EXPECT_EQ(wearOf(sharp, {}, SHARP, ENGAGEMENTS[0]).revolutions, 0u);
}

}  // namespace
}  // namespace smartmill::program
