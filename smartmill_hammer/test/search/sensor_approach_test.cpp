#include "smartmill_hammer/search/sensor_approach.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "../closed_form_machine.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace hammer {
namespace {

constexpr double FACE = 6.4e-3, READ = 2e-3, HALF_GAP = 250e-6;

/// A fluted tool before a sensor whose gain is off its nominal one, in closed form.
struct Bench {
  ToolGeometry tool;
  HammerStation station;
  FluteProfile profile;
  double gain_error = 0.0, set_up = 0.0;  // [1], [m] further off than told

  Bench(int teeth, double diameter, double helix_deg, double depth) {
    tool.teeth = teeth;
    tool.diameter = diameter;
    tool.helix = units::radFromDeg(helix_deg);
    station.gap_at_zero_volt = HALF_GAP;
    station.gain_volt = station.range_volt = 10.0;
    station.flute_depth = depth;
    const double pitch = units::TWO_PI / teeth;
    profile = FluteProfile::even(teeth, depth, 0.22 * pitch, 0.3 * pitch);
  }
  double volt(double turned) const {
    const double gap = 2.0 * HALF_GAP + set_up + profile.retreat(turned, 0.0, 0.0);
    return 10.0 * (1.0 + gain_error) * (HALF_GAP / gap - 1.0);
  }
  /// As the flute's search reads: about a flute, a few steps to either side.
  SensorApproach searched() const {
    SensorApproach approach(station, tool, {FACE, 0.15, 0.5 * HALF_GAP});
    std::vector<FluteSearch::Reading> readings;
    for (const double deg : {-38.0, -14.0, -4.0, -1.0, 0.0, 1.0, 3.0, 8.5, 23.0})
      readings.push_back({units::radFromDeg(deg), volt(units::radFromDeg(deg))});
    approach.fluteSeen(readings, 0.0, volt(0.0));
    return approach;
  }
  /// [m] to the first touch of the round face, from there: by a fine grid over it.
  double contact(double turned) const {
    constexpr int STEPS = 30;
    const double radius = tool.radius();
    double behind = 1.0;
    for (int i = -STEPS; i <= STEPS; ++i) {
      for (int k = -STEPS; k <= STEPS; ++k) {
        if (i * i + k * k > STEPS * STEPS) continue;
        const double aside = 0.5 * FACE * i / STEPS, up = 0.5 * FACE * k / STEPS;
        if (std::abs(aside) >= radius || up < -READ) continue;
        const double a = std::asin(aside / radius);
        const double off = profile.retreat(turned - a, tool.lag() * up, 0.0);
        behind = std::min(behind, radius - (radius - off) * std::cos(a));
      }
    }
    return 2.0 * HALF_GAP + set_up + behind;
  }
  SensorApproach::Place place(double turned) const { return {turned, READ, tool.lag(), tool.lag()}; }
};

// Whatever the sensor's gain, the tool and how it is turned, something is left before the face.
TEST(SensorApproach, NeverAllowsATouch) {
  double least = 1.0;
  for (const double gain_error : {-0.1, 0.0, 0.1}) {
    for (const int teeth : {2, 3, 4, 6}) {
      for (const double diameter : {8e-3, 16e-3, 24e-3}) {
        for (const double helix : {0.0, 30.0, 43.0}) {
          Bench bench(teeth, diameter, helix, std::min(1.4e-3, 0.08 * diameter));
          bench.gain_error = gain_error;
          for (const double set_up : {-100e-6, 100e-6}) {
            bench.set_up = set_up;
            SensorApproach approach = bench.searched();
            const auto room = [&] {
              for (double turned = 0.0; turned < units::TWO_PI / teeth; turned += 0.4)
                least = std::min(least, bench.contact(turned) - approach.travel(bench.place(turned)));
            };
            room();
            approach.curveSeen({-10.0 * (1.0 + gain_error), 10.0 * (1.0 + gain_error) * HALF_GAP});
            room();
          }
        }
      }
    }
  }
  EXPECT_GT(least, 0.0);
  std::cout << "least room left " << 1e6 * least << " um\n";
}

// The tool that touched: 24 mm, four teeth, 43 degrees, a sensor that shows a tenth more than its nominal
// curve, 62.6 degrees on from a flute. By the nominal curve the flank 14 degrees off stands half a millimetre
// deeper than it does.
TEST(SensorApproach, ASensorOfLargerGainTellsNoDeeperFlanks) {
  Bench bench(4, 24e-3, 43.0, 1.36e-3);
  bench.gain_error = 0.1;
  const SensorApproach approach = bench.searched();
  for (const double deg : {-38.0, -20.0, -14.0, -7.0, 5.0, 8.5, 15.0, 23.0, 40.0}) {
    const double turned = units::radFromDeg(deg);
    EXPECT_LE(approach.leastRetreat(turned), bench.profile.retreat(turned, 0.0, 0.0) + 2e-6) << deg;
  }
  EXPECT_GT(approach.nominalGap(bench.volt(units::radFromDeg(-14.0))) - approach.nominalGap(bench.volt(0.0)),
            bench.profile.retreat(units::radFromDeg(-14.0), 0.0, 0.0) + 150e-6);
}

// The curve that the approach tells gives back what the nominal one's error took.
TEST(SensorApproach, TheCurveSeenOnTheWayAllowsMore) {
  Bench bench(4, 24e-3, 20.0, 1.3e-3);
  bench.gain_error = -0.08;
  SensorApproach approach = bench.searched();
  const SensorApproach::Place gullet = bench.place(units::radFromDeg(45.0));
  const double before = approach.travel(gullet);
  approach.curveSeen({-20.0, 10.0 * HALF_GAP});  // of no sensor that the station has
  EXPECT_EQ(approach.travel(gullet), before);
  approach.curveSeen({-9.2, 9.2 * HALF_GAP});
  EXPECT_GT(approach.travel(gullet), before + 0.15e-3);
  EXPECT_LT(approach.travel(gullet), bench.contact(gullet.turned) - 0.4 * HALF_GAP);
}

// A straight flute's gullet is as deep over all the face's height; of a helix the flutes above and below are
// turned into it, and what the middle sees is not what the face meets.
TEST(SensorApproach, TheHelixTurnsAFluteBeforeTheFace) {
  Bench bench(4, 12e-3, 40.0, 0.9e-3);
  const SensorApproach approach = bench.searched();
  const double gullet = units::radFromDeg(45.0);
  SensorApproach::Place straight = bench.place(gullet);
  straight.lag_low = straight.lag_high = 0.0;
  const double lost = approach.travel(straight) - approach.travel(bench.place(gullet));
  EXPECT_GT(lost, 0.1e-3);
  // What is not known of the helix counts with its worst.
  SensorApproach::Place unknown = bench.place(gullet);
  unknown.lag_low = 0.0;
  unknown.lag_high = std::tan(units::radFromDeg(45.0)) / bench.tool.radius();
  EXPECT_LE(approach.travel(unknown), approach.travel(bench.place(gullet)) + 1e-9);
}

// Nothing known: round. Its foremost line ends the way where a flute would.
TEST(SensorApproach, OfNothingKnownTheToolIsRound) {
  const Bench bench(3, 16e-3, 30.0, 1e-3);
  SensorApproach approach = bench.searched();
  approach.forget();
  for (const double turned : {0.0, 0.3, 1.0})
    EXPECT_NEAR(approach.travel(bench.place(turned)), HALF_GAP / (1.0 - 0.5 / 1.15) - 0.5 * HALF_GAP, 1e-9);
}

}  // namespace
}  // namespace hammer
}  // namespace smartmill
