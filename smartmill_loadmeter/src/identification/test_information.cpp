#include "smartmill_loadmeter/identification/test_information.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/torque_sensitivity.h"

namespace smartmill::loadmeter {

namespace {

bool isCut(const CuttingCondition& test) {
  return test.kind == CuttingCondition::Kind::cut;
}

// Whether these tests determine friction and both coefficients by themselves.
bool isComplete(const std::vector<CuttingCondition>& tests) {
  std::set<double> speeds, feeds;
  for (const CuttingCondition& t : tests) {
    if (isCut(t)) {
      feeds.insert(t.engagement.feed_per_tooth);
    } else {
      speeds.insert(t.spindle_speed);
    }
  }
  return speeds.size() >= 2 && feeds.size() >= 2;
}

// Whether air cuts at most as fast, and at least as fast, exist for every cut for which the plan has them:
// friction is not extrapolated.
bool enclosesCuts(const std::vector<CuttingCondition>& selected, const std::vector<CuttingCondition>& plan) {
  const auto hasAir = [](const std::vector<CuttingCondition>& of, double speed, bool above) {
    return std::any_of(of.begin(), of.end(), [&](const CuttingCondition& t) {
      return !isCut(t) && (above ? t.spindle_speed >= speed : t.spindle_speed <= speed);
    });
  };
  return std::all_of(selected.begin(), selected.end(), [&](const CuttingCondition& t) {
    const double speed = t.spindle_speed;
    return !isCut(t) || ((hasAir(selected, speed, false) || !hasAir(plan, speed, false)) &&
                         (hasAir(selected, speed, true) || !hasAir(plan, speed, true)));
  });
}

std::array<double, 3> between(double low, double high) {
  return {low, 0.5 * (low + high), high};
}

std::vector<CuttingCondition> select(const std::vector<CuttingCondition>& tests,
                                     const std::vector<std::size_t>& indices) {
  std::vector<CuttingCondition> selected;
  for (const std::size_t i : indices) selected.push_back(tests[i]);
  return selected;
}

}  // namespace

TorqueCovariance expectedCovariance(const std::vector<CuttingCondition>& tests, const Spindle& spindle,
                                    const TorqueCovariance* prior, double voltage_std) {
  CutInformation information;
  if (prior) information.addKnowledge(*prior);
  for (const CuttingCondition& test : tests) information.addTest(test, spindle, voltage_std);
  return information.covariance().torque();
}

std::vector<std::size_t> neededTests(const std::vector<CuttingCondition>& tests, const Spindle& spindle,
                                     const TorqueCovariance& knowledge, double voltage_std) {
  std::vector<std::size_t> needed(tests.size());
  std::iota(needed.begin(), needed.end(), 0);
  const TorqueCovariance target = expectedCovariance(tests, spindle, nullptr, voltage_std);
  // Drops one by one the test that is missed least.
  for (;;) {
    double best = std::numeric_limits<double>::infinity();
    std::vector<std::size_t> fewer;
    for (std::size_t drop = 0; drop < needed.size(); ++drop) {
      std::vector<std::size_t> rest = needed;
      rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(drop));
      const std::vector<CuttingCondition> left = select(tests, rest);
      if (!isComplete(left) || !enclosesCuts(left, tests)) continue;
      const TorqueCovariance with = expectedCovariance(left, spindle, &knowledge, voltage_std);
      const double cost = std::max(with.tc / target.tc, with.te / target.te);
      if (cost < best) best = cost, fewer = rest;
    }
    if (!(best <= 1.0)) return needed;
    needed = fewer;
  }
}

std::optional<SuggestedCut> mostInformativeCut(const ToolGeometry& tool, const Spindle& spindle,
                                               const CuttingCoefficients& value,
                                               const TorqueCovariance& knowledge,
                                               const SuggestionLimits& limits, double voltage_std) {
  const std::array<std::array<double, 2>, 3> immersions{
      {{0.0, units::PI}, {0.0, 0.5 * units::PI}, {0.5 * units::PI, units::PI}}};  // slot, up, down
  std::optional<SuggestedCut> best;
  double smallest = std::numeric_limits<double>::infinity();
  for (const double speed : between(limits.slowest, limits.fastest)) {
    for (const auto& [entry, exit] : immersions) {
      for (const double feed : between(limits.least_feed, limits.most_feed)) {
        for (const double depth : between(limits.least_depth, limits.most_depth)) {
          SuggestedCut cut;
          cut.speed = speed;
          cut.engagement = {entry, exit, depth, feed};
          cut.torque = torqueSensitivity(tool, cut.engagement).torque(value.ktc, value.kte);
          if (limits.torque > 0.0 && cut.torque > limits.torque) continue;
          if (limits.power > 0.0 && cut.torque * speed > limits.power) continue;
          CuttingCondition condition;
          condition.tool = tool;
          condition.engagement = cut.engagement;
          condition.spindle_speed = speed;
          CutInformation information;
          information.addKnowledge(knowledge);
          information.addAboveAir(condition, spindle, voltage_std);
          const TorqueCovariance after = information.covariance().torque();
          const double sum = after.tc / (value.ktc * value.ktc) + after.te / (value.kte * value.kte);
          if (!(sum < smallest)) continue;
          smallest = sum;
          cut.ktc_std = std::sqrt(after.tc);
          cut.kte_std = std::sqrt(after.te);
          best = cut;
        }
      }
    }
  }
  return best;
}

}  // namespace smartmill::loadmeter
