#include "smartmill_discrepancy/search/separating_test.h"

#include <algorithm>
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

Record predicted(const MachineModel& model, const CampaignTest& test) {
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = COARSE_SUBSTEPS;
  return sim::simulateTest(model, test, LIMITS.duration, options);
}

// RMS difference of two models over the noise in one test.
double separation(const Dataset& data, const CampaignTest& test, const MachineModel& a,
                  const MachineModel& b) {
  const Record first = predicted(a, test), second = predicted(b, test);
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

TestOutcome outcomeOf(const Dataset& data, const CampaignTest& test, const MachineModel& a,
                      const MachineModel& b) {
  const Record first = predicted(a, test), second = predicted(b, test);
  const auto peakOf = [](const std::vector<double>& values) {
    double peak = 0.0;
    for (const double v : values) peak = std::max(peak, std::abs(v));
    return peak;
  };
  TestOutcome outcome;
  outcome.duration = LIMITS.duration;
  double largest = -1.0;
  for (const auto& [channel, noise] : data.noise) {
    if (!first.has(channel) || !second.has(channel)) continue;
    const double one = peakOf(first.column(channel)), other = peakOf(second.column(channel));
    if (std::abs(one - other) / noise <= largest) continue;
    largest = std::abs(one - other) / noise;
    outcome.channel = channel;
    outcome.peak = one;
    outcome.other_peak = other;
  }
  const auto first_cut = static_cast<std::size_t>(test.engage_time.value_or(0.0) * test.sample_rate);
  const auto chatters = [&](const Record& record) {
    return findChatter(record, test, first_cut).has_value();
  };
  outcome.chatters = test.engagement && (chatters(first) || chatters(second));
  return outcome;
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
            value = separation(data, test, a, b);
          } catch (const Error&) {
            continue;  // the twin cannot simulate this test
          }
          if (value <= (best ? best->difference : 0.0)) continue;
          best = SeparatingTest{"", test, value, {}};
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
  if (best) best->outcome = outcomeOf(data, best->test, a, b);
  return best;
}

}  // namespace smartmill::discrepancy
