#include "smartmill_stability/chart/bistable.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_stability_testing/oracles.h"
#include "smartmill_stability_testing/time_domain.h"

namespace smartmill::stability {
namespace {

/// Power law over 0 .. 0.4 mm, approximated by a cubic spline with closely spaced knots.
ForceCurve powerLaw(double at_tenth, double power) {
  constexpr int PIECES = 400;
  constexpr double TOP = 0.4e-3;
  ForceCurve curve;
  for (int k = 0; k <= PIECES; ++k) curve.knots.push_back(TOP * k / PIECES);
  curve.std_dev.assign(PIECES + 1, 0.0);
  const auto knot = [&](int k) { return static_cast<double>(std::clamp(k, 0, PIECES)) / PIECES; };
  for (int k = 0; k < PIECES + 3; ++k) {  // Greville abscissae
    const double x = (knot(k - 2) + knot(k - 1) + knot(k)) / 3.0 * TOP;
    curve.value.push_back(at_tenth * std::pow(x / 1e-4, power));
  }
  return curve;
}

ForceCurves powerLaws(double power) {
  ForceCurves law;
  law.tangential = powerLaw(60e3, power);
  law.radial = powerLaw(20e3, power);
  return law;
}

/// Describing function over slope for an amplitude that just reaches the surface, in closed form: the mean of
/// (1 + cos)^q is 2^q Gamma(q + 1/2) / (sqrt(pi) Gamma(q + 1)).
double grazing(double q) {
  return 2.0 / (q + 1.0) * std::pow(2.0, q) * std::tgamma(q + 0.5) /
         (std::sqrt(units::PI) * std::tgamma(q + 1.0));
}

TEST(Bistable, DescribingFunctionOfAPowerLawHasItsClosedForm) {
  for (const double q : {0.5, 0.75, 1.0}) {
    const ForceCurve law = powerLaw(60e3, q);
    EXPECT_NEAR(describingFunction(law, 0.1e-3, 0.1e-3) / describingFunction(law, 0.1e-3, 0.0), grazing(q),
                0.004)
        << q;
    // Smaller amplitude: next term of the series, 1 + (q - 1)(q - 2) / 8 s^2 + ...
    const double s = 0.3, cubic = (q - 1.0) * (q - 2.0) / 8.0 * s * s;
    EXPECT_NEAR(describingFunction(law, 0.1e-3, s * 0.1e-3) / law.slope(0.1e-3), 1.0 + cubic,
                0.1 * cubic + 1e-3)
        << q;
  }
}

// With continuous contact the limit is inversely proportional to the gain: ratio of large to small limit
// 1 / grazing(q), about 6 % below 1 for Kienzle's 3/4; secant: q.
TEST(Bistable, RangeOfAPowerLawHasItsClosedForm) {
  RegenerativeSystem system = benchmarkSystem(1.0, true, false);
  system.cut = Cut::turning;
  system.teeth = 1;
  system.entry = units::PI / 2;
  const std::vector<double> speeds{units::radPerSecFromRpm(9000.0), units::radPerSecFromRpm(20000.0)};
  for (const double q : {0.6, 0.75}) {
    for (const BistableLimit& b :
         bistableLimits(system, powerLaws(q), 0.1e-3, Method::collocation, {}, speeds, 50e-3)) {
      ASSERT_TRUE(std::isfinite(b.small.depth));
      EXPECT_NEAR(b.large.depth / b.small.depth, 1.0 / grazing(q), 0.004) << q;
      EXPECT_NEAR(b.secant.depth / b.small.depth, q, 0.004) << q;
    }
  }
}

constexpr double SOFT = 0.02, HARD = 60.0;

bool chatters(const RegenerativeSystem& system, double q, double speed, double depth, double disturbance) {
  constexpr int STEPS = 720;
  TimeDomain run(system, benchmark(), {}, speed, depth, 0.1e-3, STEPS);
  run.setLaw(powerLaws(q));
  run.setDisturbance(disturbance);
  return chattersInTime(run, STEPS / system.teeth, 0.1e-3);
}

// Time-domain simulation of a slot with a tool that may leave the cut: a small vibration grows above the
// limit of the slopes within 2 %. Slightly below it the cut remains stable after a small disturbance and
// chatters after a large one. 10 % below the large limit it is always stable (the limit in time differs by -9
// .. +8 % over the speeds).
TEST(Bistable, BothStatesPersistInTimeBetweenTheLimits) {
  const RegenerativeSystem system = benchmarkSystem(1.0, true, false);
  for (const double rpm : {8000.0, 12000.0}) {
    const double speed = units::radPerSecFromRpm(rpm), q = 0.6;
    const BistableLimit b =
        bistableLimits(system, powerLaws(q), 0.1e-3, Method::collocation, {}, {speed}, 50e-3).front();
    EXPECT_TRUE(chatters(system, q, speed, 1.02 * b.small.depth, SOFT)) << rpm;
    EXPECT_FALSE(chatters(system, q, speed, 0.98 * b.small.depth, SOFT)) << rpm;
    EXPECT_TRUE(chatters(system, q, speed, 0.98 * b.small.depth, HARD)) << rpm;
    EXPECT_FALSE(chatters(system, q, speed, 0.9 * b.large.depth, HARD)) << rpm;
  }
}

TEST(Bistable, ConstantCoefficientsAlongTheArcGiveTheSameLimits) {
  for (const double helix : {0.0, 0.5}) {
    RegenerativeSystem plain = benchmarkSystem(0.5, true, true);
    plain.helix = helix;
    RegenerativeSystem along = plain;
    along.along_arc = [&plain](double) { return std::array<double, 2>{plain.kt, plain.kr}; };
    const double speed = units::radPerSecFromRpm(9000.0);
    const double expected = makeSolver(Method::collocation, plain)->limit(speed, 20e-3).depth;
    EXPECT_NEAR(makeSolver(Method::collocation, along)->limit(speed, 20e-3).depth, expected, 1e-4 * expected);
  }
  RegenerativeSystem system = benchmarkSystem(0.5, true, true);
  system.along_arc = [](double) { return std::array<double, 2>{1e9, 0.0}; };
  EXPECT_NE(errorOf([&] { makeSolver(Method::zero_order, system); }), "");
}

TEST(Bistable, RefusesAFeedBeyondTheForceCurve) {
  const RegenerativeSystem system = benchmarkSystem(1.0, true, false);
  EXPECT_NE(errorOf([&] {
              bistableLimits(system, powerLaws(0.75), 1e-3, Method::collocation, {}, {1000.0}, 5e-3);
            }).find("0 .. 0.4000 mm"),
            std::string::npos);
}

TEST(Bistable, ProgramWritesAndDrawsBothLimits) {
  const TemporaryFolder folder;
  writeForceCurves(powerLaws(0.6), folder.file("law.yaml"));
  const auto run = [&](const std::string& rest) {
    return std::system((std::string(LOBES) + " " + MODEL_FILE +
                        " --entry-deg 0 --exit-deg 180 --speeds 8000:9000:2 --max-depth-mm 5 --force-curve " +
                        folder.file("law.yaml") + " -o " + folder.file("chart.csv") + rest +
                        " >/dev/null 2>&1")
                           .c_str());
  };
  ASSERT_EQ(run(" --feed-mm 0.1"), 0);
  std::ifstream csv(folder.file("chart.csv"));
  std::string head, line;
  std::getline(csv, head);
  EXPECT_EQ(head, "rpm,limit_mm,chatter_hz,kind,large_limit_mm,secant_limit_mm");
  std::getline(csv, line);
  double rpm = 0.0, small = 0.0, large = 0.0;
  char kind[16];
  ASSERT_EQ(std::sscanf(line.c_str(), "%lf,%lf,%*f,%15[a-z],%lf", &rpm, &small, kind, &large), 4) << line;
  EXPECT_NEAR(large / small, 1.0 / grazing(0.6), 0.02);
  EXPECT_TRUE(std::ifstream(folder.file("chart.png")).good());
  EXPECT_NE(run(""), 0);
  EXPECT_NE(run(" --feed-mm 0.1 --errors"), 0);
}

}  // namespace
}  // namespace smartmill::stability
