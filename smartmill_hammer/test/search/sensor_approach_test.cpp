#include "smartmill_hammer/search/sensor_approach.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "../closed_form_machine.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

constexpr double FACE = 6.4e-3, READ = 2e-3, HALF_GAP = 250e-6;

/// A fluted tool in front of a sensor whose gain deviates from the nominal one, in closed form.
struct Bench {
  ToolGeometry tool;
  HammerStation station;
  FluteProfile profile;
  double gain_error = 0.0, set_up = 0.0;  // [1], [m] additional distance

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
  /// Measurements of a flute search: around a flute, a few steps to either side.
  SensorApproach searched() const {
    SensorApproach approach(station, tool, {FACE, 0.15, 0.5 * HALF_GAP});
    std::vector<FluteSearch::Measurement> measurements;
    for (const double deg : {-38.0, -14.0, -4.0, -1.0, 0.0, 1.0, 3.0, 8.5, 23.0})
      measurements.push_back({units::radFromDeg(deg), volt(units::radFromDeg(deg))});
    approach.startFromFlute(measurements, 0.0, volt(0.0));
    return approach;
  }
  /// [m] to the first contact with the round face, by a fine grid over it.
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
  SensorApproach::Pose pose(double turned) const { return {turned, READ, tool.lag(), tool.lag()}; }
};

// For any gain of the sensor, tool and angle a distance to the face remains.
TEST(SensorApproach, NeverPermitsContact) {
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
                least = std::min(least, bench.contact(turned) - approach.safeTravel(bench.pose(turned)));
            };
            room();
            approach.setCurve({-10.0 * (1.0 + gain_error), 10.0 * (1.0 + gain_error) * HALF_GAP});
            room();
          }
        }
      }
    }
  }
  EXPECT_GT(least, 0.0);
  std::cout << "least clearance " << 1e6 * least << " um\n";
}

// A case of contact without the curve's error: 24 mm, four teeth, 43 degrees, a sensor with a tenth more gain
// than nominal, 62.6 degrees from a flute. By the nominal curve the flank 14 degrees away is half a
// millimetre deeper than it is.
TEST(SensorApproach, LargerGainDoesNotDeepenFlanks) {
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

// The measured curve removes the margin for the nominal curve's error.
TEST(SensorApproach, TheMeasuredCurvePermitsMoreTravel) {
  Bench bench(4, 24e-3, 20.0, 1.3e-3);
  bench.gain_error = -0.08;
  SensorApproach approach = bench.searched();
  const SensorApproach::Pose gullet = bench.pose(units::radFromDeg(45.0));
  const double before = approach.safeTravel(gullet);
  approach.setCurve({-20.0, 10.0 * HALF_GAP});  // contradicts the station's sensor
  EXPECT_EQ(approach.safeTravel(gullet), before);
  approach.setCurve({-9.2, 9.2 * HALF_GAP});
  EXPECT_GT(approach.safeTravel(gullet), before + 0.15e-3);
  EXPECT_LT(approach.safeTravel(gullet), bench.contact(gullet.turned) - 0.4 * HALF_GAP);
}

// The gullet of a straight flute is equally deep over the face's height; with a helix, the flutes above and
// below the middle of the face are turned towards it.
TEST(SensorApproach, TheHelixTurnsAFluteTowardsTheFace) {
  Bench bench(4, 12e-3, 40.0, 0.9e-3);
  const SensorApproach approach = bench.searched();
  const double gullet = units::radFromDeg(45.0);
  SensorApproach::Pose straight = bench.pose(gullet);
  straight.lag_low = straight.lag_high = 0.0;
  const double lost = approach.safeTravel(straight) - approach.safeTravel(bench.pose(gullet));
  EXPECT_GT(lost, 0.1e-3);
  // An uncertain helix counts with its worst value.
  SensorApproach::Pose unknown = bench.pose(gullet);
  unknown.lag_low = 0.0;
  unknown.lag_high = std::tan(units::radFromDeg(45.0)) / bench.tool.radius();
  EXPECT_LE(approach.safeTravel(unknown), approach.safeTravel(bench.pose(gullet)) + 1e-9);
}

// Without flanks the tool is round and ends the travel where a flute would.
TEST(SensorApproach, WithoutFlanksTheToolIsRound) {
  const Bench bench(3, 16e-3, 30.0, 1e-3);
  SensorApproach approach = bench.searched();
  approach.clearFlanks();
  for (const double turned : {0.0, 0.3, 1.0})
    EXPECT_NEAR(approach.safeTravel(bench.pose(turned)), HALF_GAP / (1.0 - 0.5 / 1.15) - 0.5 * HALF_GAP,
                1e-9);
}

}  // namespace
}  // namespace smartmill::hammer
