#include "smartmill_stability/chart/surface_error.h"

#include <complex>
#include <cstdlib>
#include <fstream>

#include <gtest/gtest.h>

#include "smartmill_core/io/csv.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_stability_testing/oracles.h"
#include "smartmill_stability_testing/time_domain.h"

namespace smartmill::stability {
namespace {

using units::PI;
using units::TWO_PI;
using Complex = std::complex<double>;

/// A finishing cut of the benchmark with a second mode in y.
struct Case {
  ModalModel x = benchmark(), y = benchmark();
  RegenerativeSystem system;
  double speed, depth;

  Case(double immersion, bool down, int teeth, double helix_deg, double rpm, double depth_mm)
      : system(benchmarkSystem(immersion, down, true)),
        speed(units::radPerSecFromRpm(rpm)),
        depth(depth_mm * units::MM) {
    y.modes.push_back({1710.0, 0.02, 2.0e-7});
    system.modes = systemModes(x, y);
    system.teeth = teeth;
    system.helix = units::radFromDeg(helix_deg);
    system.chip = ChipGeometry{};
    system.chip->feed = 0.08e-3;
  }
};

/// [m] Offsets of the wall at heights by the frequency-domain solution of Schmitz and Smith: the force of the
/// rigid tool is sampled over a revolution, its Fourier series is multiplied with the receptance in y (the
/// modes of the benchmark have no cross terms) and summed where a tooth generates the wall.
std::vector<double> frequencyDomain(const Case& c, const std::vector<double>& heights) {
  constexpr int samples = 14400;
  int slices = 60;
  const RegenerativeSystem& s = c.system;
  const double lag = s.helix > 0.0 ? 2.0 * std::tan(s.helix) / s.diameter : 0.0;
  if (lag == 0.0) slices = 1;
  std::vector<double> force(static_cast<std::size_t>(samples), 0.0);
  for (int i = 0; i < samples; ++i) {
    for (int k = 0; k < s.teeth; ++k) {
      for (int j = 0; j < slices; ++j) {
        const double phi = std::fmod(TWO_PI * (i + 0.5) / samples + TWO_PI * k / s.teeth -
                                         lag * c.depth * (j + 0.5) / slices + 2.0 * TWO_PI,
                                     TWO_PI);
        // Share of the sample in the arc: without it an entry is late by up to half a sample, a phase of 1 %
        // of the vibration in a slow cut.
        const double half = PI / samples;
        const double share = (std::min(phi + half, s.exit) - std::max(phi - half, s.entry)) / (2.0 * half);
        if (share <= 0.0) continue;
        const double h = s.chip->feed * std::sin(phi);
        const double ft = s.kt * h + s.chip->kte, fr = s.kr * h + s.chip->kre;
        force[static_cast<std::size_t>(i)] +=
            share * c.depth / slices * (ft * std::sin(phi) - fr * std::cos(phi));
      }
    }
  }
  const bool down = s.exit > PI - 1e-9;
  std::vector<double> sums(heights.size(), 0.0);
  const double highest = 60.0 * 1710.0;  // [Hz] the truncated rest of a jump of the force is below 1e-4 of it
  for (int n = 0; n * c.speed / TWO_PI <= highest && n < samples / 2; n += s.teeth) {
    Complex coefficient = 0.0;
    for (int i = 0; i < samples; ++i)
      coefficient +=
          force[static_cast<std::size_t>(i)] * std::polar(1.0 / samples, -TWO_PI * n * (i + 0.5) / samples);
    const Complex response = coefficient * c.y.response(n * c.speed / TWO_PI);
    for (std::size_t h = 0; h < heights.size(); ++h) {
      const double turned = (down ? PI : 0.0) + lag * heights[h];
      sums[h] += (down ? -1.0 : 1.0) * (n == 0 ? 1.0 : 2.0) * (response * std::polar(1.0, n * turned)).real();
    }
  }
  return sums;
}

/// [m] The same in the time domain with the surface left by each tooth, without edge forces: [tooth].
std::vector<double> timeDomain(const Case& c, int revolutions = 150, int steps = 1440) {
  TimeDomain run(c.system, c.x, c.y, c.speed, c.depth, c.system.chip->feed, steps);
  run.setDisturbance(0.0);
  if (!c.system.chip->radius_offset.empty()) run.setRunout(c.system.chip->radius_offset);
  const bool down = c.system.exit > PI - 1e-9;
  std::vector<double> last(static_cast<std::size_t>(steps));
  for (int r = 0; r < revolutions; ++r)
    for (int i = 0; i < steps; ++i) last[static_cast<std::size_t>(i)] = run.step()[1];
  std::vector<double> offsets;
  double angle = 0.0;
  for (int k = 0; k < c.system.teeth; ++k) {
    const int at = static_cast<int>(std::lround(((down ? PI : 0.0) - angle) / TWO_PI * steps)) + steps;
    const double own = c.system.chip->radius_offset.empty()
                           ? 0.0
                           : c.system.chip->radius_offset[static_cast<std::size_t>(k)];
    offsets.push_back(own + (down ? -1.0 : 1.0) * last[static_cast<std::size_t>(at % steps)]);
    angle += c.system.pitchOf(k);
  }
  return offsets;
}

TEST(SurfaceError, IsThatOfTheFrequencyDomain) {
  struct {
    double immersion;
    bool down;
    int teeth;
    double helix, rpm, depth_mm;
  } const cases[] = {{0.1, true, 2, 0.0, 9000, 1.0},
                     {0.1, false, 2, 0.0, 9000, 1.0},
                     {0.1, true, 4, 30.0, 7000, 6.0},
                     {0.3, false, 3, 45.0, 12000, 8.0},
                     {0.01, true, 1, 0.0, 6000, 0.5},  // tiny immersion, one tooth
                     {0.01, false, 1, 20.0, 6000, 3.0},
                     {0.1, true, 2, 0.0, 27660, 1.0},   // tooth passing frequency at the mode in y
                     {0.1, false, 2, 0.0, 13830, 1.0},  // its second harmonic
                     {0.1, true, 2, 0.0, 900, 1.0}};    // 30 tooth passing harmonics below the first mode
  for (const auto& row : cases) {
    Case c(row.immersion, row.down, row.teeth, row.helix, row.rpm, row.depth_mm);
    c.system.chip->kte = 8e3;
    c.system.chip->kre = 12e3;
    const WallPrediction wall(c.system);
    const std::vector<double> heights{0.0, 0.4 * c.depth, c.depth},
        expected = frequencyDomain(c, heights), found = wall.offsets(c.speed, c.depth, heights)[0];
    for (std::size_t h = 0; h < heights.size(); ++h) {
      // The sampled force resolves entry and exit to 0.002 of the smallest arc.
      EXPECT_NEAR(found[h], expected[h], 3e-3 * std::abs(expected[h]) + 3e-9)
          << row.rpm << " rpm, " << row.immersion << ", helix " << row.helix << ", height " << heights[h];
    }
  }
}

TEST(SurfaceError, IsThatOfTheTimeDomain) {
  struct {
    bool down;
    int teeth;
    double helix, rpm, depth_mm;
  } const cases[] = {{true, 2, 0.0, 9000, 0.8},   {false, 2, 0.0, 9000, 0.8},  {true, 4, 0.0, 6600, 0.5},
                     {false, 3, 30.0, 8100, 0.5}, {true, 2, 30.0, 14500, 1.0}, {true, 1, 0.0, 11000, 1.0}};
  for (const auto& row : cases) {
    const Case c(0.1, row.down, row.teeth, row.helix, row.rpm, row.depth_mm);
    const double expected = timeDomain(c)[0];
    // Angles on a grid of a quarter degree in an arc of 37 deg.
    EXPECT_NEAR(WallPrediction(c.system).offsets(c.speed, c.depth, {0.0})[0][0], expected,
                0.02 * std::abs(expected) + 5e-8)
        << row.rpm;
  }
}

// With runout and uneven pitch each tooth has its own chip, some miss the cut, and the regeneration does not
// cancel.
TEST(SurfaceError, WithUnequalTeethIsThatOfTheTimeDomain) {
  for (const bool down : {true, false}) {
    for (const double runout : {5e-6, 60e-6}) {
      Case c(0.1, down, 2, 0.0, 9000, 0.8);
      c.system.pitch = {units::radFromDeg(170.0), units::radFromDeg(190.0)};
      c.system.chip->radius_offset = {runout, -runout};
      const std::vector<double> expected = timeDomain(c);
      const auto found = WallPrediction(c.system).offsets(c.speed, c.depth, {0.0});
      ASSERT_EQ(found.size(), 2u);
      for (std::size_t k = 0; k < 2; ++k)
        EXPECT_NEAR(found[k][0], expected[k], 0.03 * std::abs(expected[0]) + 1e-7) << down << " " << runout;
    }
  }
}

TEST(SurfaceError, UnequalTeethBecomeAlike) {
  Case c(0.1, true, 2, 30.0, 9000, 2.0);
  c.system.chip->kte = 8e3;
  c.system.chip->kre = 12e3;
  const double alike = WallPrediction(c.system).at(c.speed, c.depth).error;
  c.system.chip->radius_offset = {1e-10, -1e-10};
  const WallPrediction unequal(c.system);
  ASSERT_FALSE(unequal.alike());
  EXPECT_NEAR(unequal.at(c.speed, c.depth).error, alike, 0.01 * std::abs(alike));
}

// A slow tooth with an overdamped mode leaves the wall under its edge force alone, where its chip vanishes:
// kre b / k, away from the wall.
TEST(SurfaceError, OfASlowCutIsTheDeflectionUnderTheEdgeForce) {
  RegenerativeSystem system = benchmarkSystem(0.2, true, true);
  ModalModel stiff;
  stiff.modes = {{2000.0, 0.7, 1e-7}};
  system.modes = systemModes(stiff, stiff);
  system.chip = ChipGeometry{};
  system.chip->feed = 0.05e-3;
  system.chip->kre = 20e3;
  const MachinedWall wall = WallPrediction(system).at(units::radPerSecFromRpm(60.0), 2e-3);
  EXPECT_NEAR(wall.error, -20e3 * 2e-3 * 1e-7, 0.01 * 4e-6);  // the chip 1 ms before the exit is not yet zero
}

TEST(SurfaceError, FeedMarksAreMartellottis) {
  for (const bool down : {true, false}) {
    Case c(0.1, down, 4, 0.0, 3000, 0.1);
    c.system.chip->feed = 0.3e-3;
    const MachinedWall wall = WallPrediction(c.system).at(c.speed, c.depth);
    const double f = 0.3e-3, r = 0.01, h = f * f / (8.0 * (r + (down ? -1.0 : 1.0) * f * 4 / PI));
    EXPECT_NEAR(wall.peak_to_valley, h, 0.01 * h);
    EXPECT_NEAR(wall.mean_deviation, 4.0 / (9.0 * std::sqrt(3.0)) * h, 0.01 * h);  // of a parabola
  }
}

// A tooth that is longer than the others by far more than the marks leaves the wall alone, with the feed of a
// revolution.
TEST(SurfaceError, OneLongToothLeavesTheWallOfASingleTooth) {
  Case c(0.1, true, 2, 0.0, 9000, 0.1);
  for (SystemMode& mode : c.system.modes)  // rigid
    for (std::size_t a = 0; a < 2; ++a) mode.input[a] *= 1e-4;
  c.system.chip->radius_offset = {20e-6, -20e-6};
  const double f = 0.08e-3, r = 0.01 * std::pow(1.0 - f * 2 / (TWO_PI * 0.01), 2);
  const MachinedWall wall = WallPrediction(c.system).at(c.speed, c.depth);
  EXPECT_NEAR(wall.peak_to_valley, 4.0 * f * f / (8.0 * r), 0.01 * f * f / r);
  EXPECT_NEAR(wall.error, 20e-6 - 4.0 * f * f / (24.0 * r) + f * f / (24.0 * r), 1e-9);
}

// The runout of the only tooth is a larger tool.
TEST(SurfaceError, RunoutOfASingleToothShiftsTheWall) {
  Case c(0.1, true, 1, 0.0, 9000, 0.5);
  const double without = WallPrediction(c.system).at(c.speed, c.depth).error;
  c.system.chip->radius_offset = {7e-6};
  EXPECT_NEAR(WallPrediction(c.system).at(c.speed, c.depth).error, without + 7e-6, 1e-12);
}

TEST(SurfaceError, IsProportionalToTheForceAndChangesItsSignAtTheMode) {
  Case c(0.1, true, 2, 0.0, 26000, 0.4);
  const double first = WallPrediction(c.system).at(c.speed, c.depth).error;
  EXPECT_NEAR(WallPrediction(c.system).at(c.speed, 2.0 * c.depth).error, 2.0 * first, 1e-6 * std::abs(first));
  const double above = WallPrediction(c.system).at(units::radPerSecFromRpm(29500), c.depth).error;
  EXPECT_LT(first * above, 0.0);  // Schmitz and Smith: overcut and undercut on the two sides of a resonance
}

TEST(SurfaceError, RefusesCutsWithoutOneWall) {
  const auto message = [](double entry, double exit) {
    RegenerativeSystem system = benchmarkSystem(0.1, true, true);
    system.chip = ChipGeometry{};
    system.chip->feed = 1e-4;
    system.entry = entry;
    system.exit = exit;
    try {
      const WallPrediction wall(system);
    } catch (const std::exception& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(message(0.0, PI).find("expected one wall"), std::string::npos);
  EXPECT_NE(message(1.0, 2.0).find("expected one wall"), std::string::npos);
  EXPECT_EQ(message(2.5, PI), "");
}

SurfaceMap benchmarkMap(double kt_share) {
  const Case c(0.1, true, 2, 0.0, 9000, 1.0);
  const UncertainSystem uncertain(c.system, std::vector<ModeUncertainty>(c.system.modes.size()), kt_share,
                                  kt_share);
  std::vector<double> speeds, depths;
  for (int i = 0; i <= 60; ++i) speeds.push_back(units::radPerSecFromRpm(8000.0 + 100.0 * i));
  for (int i = 1; i <= 10; ++i) depths.push_back(2e-4 * i);
  return surfaceMap(uncertain, speeds, depths);
}

// The error is linear in both coefficients: its variance is the sum of those of its two parts.
TEST(SurfaceMap, StandardDeviationFollowsTheCoefficients) {
  const SurfaceMap map = benchmarkMap(0.1);
  RegenerativeSystem tangential = Case(0.1, true, 2, 0.0, 9000, 1.0).system;
  tangential.kr = 0.0;
  const WallPrediction part(tangential);
  for (std::size_t s = 0; s < map.speeds.size(); s += 20) {
    const double whole = map.wall[s][4].error, of_kt = part.at(map.speeds[s], map.depths[4]).error;
    const double expected = 0.1 * std::hypot(of_kt, whole - of_kt);
    EXPECT_NEAR(map.error_std[s][4], expected, 0.35 * expected);  // three sigma of 40 draws
  }
  EXPECT_LT(benchmarkMap(0.0).error_std[10][4], 1e-12);
}

TEST(SurfaceMap, FinishingCutsAreStableAndWithinTheTolerance) {
  const SurfaceMap map = benchmarkMap(0.03);
  const double tolerance = 8e-6;
  const std::vector<FinishingCut> cuts = finishingCuts(map, tolerance, 0.01, 0.2, 5);
  ASSERT_FALSE(cuts.empty());
  const Case c(0.1, true, 2, 0.0, 9000, 1.0);
  RegenerativeSystem plain = c.system;
  plain.chip.reset();
  for (const FinishingCut& cut : cuts) {
    for (const double side : {0.99, 1.0, 1.01}) {
      EXPECT_LE(std::abs(WallPrediction(c.system).at(side * cut.speed, cut.depth).error), tolerance);
      EXPECT_GT(makeSolver(Method::collocation, plain)->limit(side * cut.speed, 10e-3).depth, cut.depth);
    }
  }
  // A tighter tolerance removes less.
  const std::vector<FinishingCut> tight = finishingCuts(map, 2e-6, 0.01, 0.2, 5);
  ASSERT_FALSE(tight.empty());
  EXPECT_LE(tight[0].speed * tight[0].depth, cuts[0].speed * cuts[0].depth);
}

TEST(SurfaceError, ProgramWritesAndDrawsTheMap) {
  const TemporaryFolder folder;
  const auto run = [&](const std::string& rest) {
    return std::system((std::string(LOBES) + " " + MODEL_FILE +
                        " --entry-deg 143 --exit-deg 180 --speeds 8000:10000:11 -o " +
                        folder.file("chart.csv") + rest + " >" + folder.file("out.txt") + " 2>&1")
                           .c_str());
  };
  ASSERT_EQ(run(" --surface-error " + folder.file("walls.csv") +
                " --max-depth-mm 2 --feed-mm 0.08 --tolerance-um 20"),
            0);
  const NumberTable table = readNumberTable(folder.file("walls.csv"));
  EXPECT_EQ(table.column("error_um").size(), 11u * 40u);
  EXPECT_TRUE(std::ifstream(folder.file("walls.png")).good());
  std::ifstream out(folder.file("out.txt"));
  const std::string text((std::istreambuf_iterator<char>(out)), std::istreambuf_iterator<char>());
  EXPECT_NE(text.find("finishing cuts within 20 um"), std::string::npos) << text;
  // A cut that is stable at all depths is drawn too.
  ASSERT_EQ(run(" --surface-error " + folder.file("walls.csv") + " --feed-mm 0.08 --max-depth-mm 0.05"), 0);
  EXPECT_NE(run(" --max-depth-mm 2 --surface-error " + folder.file("walls.csv")), 0);
  EXPECT_NE(run(" --max-depth-mm 2 --tolerance-um 5"), 0);
}

}  // namespace
}  // namespace smartmill::stability
