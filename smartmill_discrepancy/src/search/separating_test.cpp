#include "smartmill_discrepancy/search/separating_test.h"

#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

/// Variations of a campaign's tests.
struct SeparatingTestOptions {
  std::vector<double> speeds{0.4, 1.0, 1.8}, feeds{0.4, 1.0, 2.0}, depths{0.5, 1.0, 2.0};  ///< [1] factors
  double engage_time = 0.02, duration = 0.15;  ///< [s] of a cut: a few revolutions after the entry
};

const SeparatingTestOptions LIMITS;

// RMS difference of two models over the noise in one test.
double separation(const Dataset& data, const CampaignTest& test, const MachineModel& a, const MachineModel& b,
                  double duration) {
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = COARSE_SUBSTEPS;
  const Record first = sim::simulateTest(a, test, duration, options);
  const Record second = sim::simulateTest(b, test, duration, options);
  double squares = 0.0;
  std::size_t count = 0;
  for (const auto& [channel, noise] : data.noise) {
    if (!first.has(channel) || !second.has(channel)) continue;
    const auto &x = first.column(channel), &y = second.column(channel);
    for (std::size_t i = 0; i < x.size(); ++i) squares += (x[i] - y[i]) * (x[i] - y[i]) / (noise * noise);
    count += x.size();
  }
  return count ? std::sqrt(squares / static_cast<double>(count)) : 0.0;
}

/// ", feed at 90 deg from +x"; empty: along +x.
std::string feedText(const CampaignTest& test) {
  return test.feed_direction == 0.0
             ? ""
             : formatted(", feed at %.0f deg from +x", units::degFromRad(test.feed_direction));
}

}  // namespace

std::optional<SeparatingTest> separatingTest(const Dataset& data, const MachineModel& a,
                                             const MachineModel& b) {
  std::optional<SeparatingTest> best;
  for (const TestData& t : data.tests) {
    if (t.test.kind == TestKind::tap || t.chatter) continue;
    for (const double speed : LIMITS.speeds) {
      for (const double feed : LIMITS.feeds) {
        for (const double depth : LIMITS.depths) {
          if (t.test.kind == TestKind::air && (feed != 1.0 || depth != 1.0)) continue;
          CampaignTest test = t.test;
          test.spindle_speed *= speed;
          if (test.engagement) {
            test.engagement->feed_per_tooth *= feed;
            test.engagement->axial_depth *= depth;
            test.engage_time = LIMITS.engage_time;
          }
          double value = 0.0;
          try {
            value = separation(data, test, a, b, LIMITS.duration);
          } catch (const Error&) {
            continue;  // the twin cannot simulate this test
          }
          if (value <= (best ? best->difference : 0.0)) continue;
          best = SeparatingTest{"", test, value};
          if (test.engagement) {
            best->text = formatted(
                "a cut at %.0f rpm, %.3g mm per tooth, %.3g mm deep, from %.0f to %.0f deg%s: the "
                "predictions differ by %.2g times the noise",
                units::rpmFromRadPerSec(test.spindle_speed), test.engagement->feed_per_tooth * 1e3,
                test.engagement->axial_depth * 1e3, units::degFromRad(test.engagement->entry),
                units::degFromRad(test.engagement->exit), feedText(test).c_str(), value);
          } else {
            best->text = formatted("an air cut at %.0f rpm: the predictions differ by %.2g times the noise",
                                   units::rpmFromRadPerSec(test.spindle_speed), value);
          }
        }
      }
    }
  }
  return best;
}

}  // namespace smartmill::discrepancy
