#include "smartmill_loadmeter/identification/force_curve.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

/// Kienzle's power laws: 60 and 25 N/mm at 0.1 mm.
double tangential(double h) {
  return 60e3 * std::pow(h / 1e-4, 0.75);
}
double radial(double h) {
  return 25e3 * std::pow(h / 1e-4, 0.6);
}

/// Straight teeth: forces in closed form, several teeth at once.
AngleRecord cut(int teeth, const Engagement& e, double noise, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, noise);
  AngleRecord record;
  record.engagement = e;
  for (int i = 0; i < 4000; ++i) {
    const double angle = units::TWO_PI * i / 173.0;
    double fx = normal(random), fy = normal(random);
    for (int t = 0; t < teeth; ++t) {
      const double phi = std::fmod(angle + units::TWO_PI * t / teeth, units::TWO_PI);
      if (phi <= e.entry || phi >= e.exit) continue;
      const double h = e.feed_per_tooth * std::sin(phi);
      fx += e.axial_depth * (-tangential(h) * std::cos(phi) - radial(h) * std::sin(phi));
      fy += e.axial_depth * (tangential(h) * std::sin(phi) - radial(h) * std::cos(phi));
    }
    record.angle.push_back(angle);
    record.fx.push_back(fx);
    record.fy.push_back(fy);
  }
  return record;
}

TEST(ForceCurve, FindsAPowerLawWithFourTeethInASlot) {
  std::vector<AngleRecord> records;
  unsigned seed = 1;
  for (const double feed : {0.1e-3, 0.2e-3, 0.325e-3})
    records.push_back(cut(4, {0.0, units::PI, 2e-3, feed}, 2.0, seed++));
  const ForceCurves curves = fitForceCurves(records, {4, 12e-3, 0.0, {}});
  EXPECT_NEAR(curves.rms, 2.0, 0.3);
  double before = 0.0;
  for (double h = 0.02e-3; h <= 0.32e-3; h += 0.01e-3) {
    EXPECT_NEAR(curves.tangential.at(h), tangential(h), 0.03 * tangential(h) + 300.0) << h;
    EXPECT_NEAR(curves.radial.at(h), radial(h), 0.03 * radial(h) + 300.0) << h;
    EXPECT_GE(curves.tangential.at(h), before);
    EXPECT_GT(curves.tangential.stdAt(h), 0.0);
    before = curves.tangential.at(h);
  }
  // The slope determines chatter: power law times exponent over chip.
  EXPECT_NEAR(curves.tangential.slope(0.2e-3), 0.75 * tangential(0.2e-3) / 0.2e-3,
              0.06 * 0.75 * tangential(0.2e-3) / 0.2e-3);
}

/// Four teeth with runout, scale errors between cuts and an angle offset, as in real records.
AngleRecord shopCut(const Engagement& e, double share, double runout, double early, double noise,
                    std::mt19937& random) {
  constexpr int TEETH = 4;
  std::normal_distribution<double> normal(0.0, noise);
  AngleRecord record;
  record.engagement = e;
  for (int i = 0; i < 360; ++i) {
    const double angle = units::TWO_PI * (i + 0.5) / 360.0;
    double fx = normal(random), fy = normal(random);
    for (int t = 0; t < TEETH; ++t) {
      const double place = 0.5 * units::PI * t, phi = std::fmod(angle + early + place, units::TWO_PI);
      const double h = e.feed_per_tooth * std::sin(phi) +
                       runout * (std::cos(1.0 + place) - std::cos(1.0 + place + 0.5 * units::PI));
      if (phi <= e.entry || phi >= e.exit || h <= 0.0) continue;
      fx += share * e.axial_depth * (-tangential(h) * std::cos(phi) - radial(h) * std::sin(phi));
      fy += share * e.axial_depth * (tangential(h) * std::sin(phi) - radial(h) * std::cos(phi));
    }
    record.angle.push_back(angle);
    record.fx.push_back(fx);
    record.fy.push_back(fy);
  }
  return record;
}

// Coverage from both sides.
TEST(ForceCurve, TheBandIsCalibrated) {
  int inside = 0, all = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> evenly(0.0, 1.0);
    const double scatter = 0.01 * std::abs(normal(random)), runout = 6e-6 * evenly(random);
    const double early = 0.005 * normal(random), noise = 0.5 + 2.0 * evenly(random);
    const int cuts = 4 + static_cast<int>(4.0 * evenly(random));
    std::vector<AngleRecord> records;
    for (int c = 1; c <= cuts; ++c)
      records.push_back(shopCut({0.0, units::PI, 2e-3, 0.2e-3 * c / cuts}, 1.0 + scatter * normal(random),
                                runout, early, noise, random));
    const ForceCurves curves = fitForceCurves(records, {4, 12e-3, 0.0, {}});
    for (const double h : {0.03e-3, 0.07e-3, 0.11e-3, 0.15e-3, 0.19e-3}) {
      inside += std::abs(curves.tangential.at(h) - tangential(h)) < 1.96 * curves.tangential.stdAt(h);
      inside += std::abs(curves.radial.at(h) - radial(h)) < 1.96 * curves.radial.stdAt(h);
      all += 2;
    }
  }
  // 95 % of about 60 x 4 independent points, within 3 deviations of that count.
  EXPECT_GT(inside, 0.91 * all);
  EXPECT_LT(inside, 0.99 * all);
  std::printf("inside 1.96 deviations: %.1f %%\n", 100.0 * inside / all);
}

TEST(ForceCurve, AFileRestoresTheCurve) {
  const TemporaryFolder folder;
  const ForceCurves curves =
      fitForceCurves({cut(2, {0.0, units::PI, 2e-3, 0.2e-3}, 2.0, 1)}, {2, 12e-3, 0.0, {}});
  const std::string file = folder.file("law.yaml");
  writeForceCurves(curves, file);
  const ForceCurves again = readForceCurves(file);
  for (const double h : {0.0, 0.01e-3, 0.1e-3, 0.2e-3, 0.3e-3}) {
    EXPECT_NEAR(again.tangential.at(h), curves.tangential.at(h), 1e-6 * curves.tangential.at(h));
    EXPECT_NEAR(again.radial.stdAt(h), curves.radial.stdAt(h), 1e-6 * curves.radial.stdAt(h));
  }
  const std::string falling =
      folder.write("falling.yaml",
                   "format: smartmill-force-curve/1\nthickest_chip_mm: 0.1\nrms_n: 1.0\ntangential: "
                   "{coefficients_n_per_mm: [1.0, 2.0, 1.5, 3.0, 4.0], std_n_per_mm: [1.0, 1.0, 1.0]}\n");
  EXPECT_NE(errorOf([&] { readForceCurves(falling); }).find("do not decrease"), std::string::npos);
}

TEST(ForceCurve, RefusesARecordWithoutAChip) {
  EXPECT_THROW(fitForceCurves({}, {4, 12e-3, 0.0, {}}), Error);
  EXPECT_THROW(fitForceCurves({cut(2, {0.0, 0.0, 2e-3, 0.1e-3}, 1.0, 1)}, {2, 12e-3, 0.0, {}}), Error);
}

}  // namespace
}  // namespace smartmill::loadmeter
