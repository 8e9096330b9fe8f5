#include "smartmill_discrepancy/gap/dependence.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include "smartmill_core/math/normal.h"
#include "smartmill_discrepancy/gap/significance.h"

namespace smartmill::discrepancy {
namespace {

struct DependenceOptions {
  std::size_t min_tests = 4;  ///< fewer have no significant correlation
  /// [1] amplitude outside cuts over that in cuts: limit for "cutting".
  double air_share = 0.3;
  double chance = 0.05;  ///< [1] probability of a correlation by chance, over all conditions
};

const DependenceOptions LIMITS;

struct Condition {
  const char* name;
  std::function<double(const CampaignTest&)> of;
};

std::vector<Condition> conditionsOf(bool among_cuts) {
  const Condition speed{"speed", [](const CampaignTest& t) { return t.spindle_speed; }};
  const Condition time{"time", [](const CampaignTest& t) { return t.start_time.value_or(0.0); }};
  if (!among_cuts) return {speed, time};
  return {speed,
          {"chip_load", [](const CampaignTest& t) { return t.engagement->feed_per_tooth; }},
          {"depth", [](const CampaignTest& t) { return t.engagement->axial_depth; }},
          // Distinguishes up- and down-milling with the same immersion.
          {"immersion",
           [](const CampaignTest& t) {
             return t.engagement->exit - t.engagement->entry + t.engagement->entry / 7.0;
           }},
          time};
}

double rmsAmplitude(const std::vector<TestAmplitude>& amplitudes) {
  double squares = 0.0;
  for (const TestAmplitude& s : amplitudes) squares += s.amplitude * s.amplitude;
  return amplitudes.empty() ? 0.0 : std::sqrt(squares / static_cast<double>(amplitudes.size()));
}

// Whether the amplitudes differ by more than their uncertainty.
bool differ(const std::vector<TestAmplitude>& amplitudes) {
  double weighted = 0.0, weights = 0.0, spread = 0.0;
  for (const TestAmplitude& s : amplitudes) {
    weighted += s.amplitude / (s.std_dev * s.std_dev);
    weights += 1.0 / (s.std_dev * s.std_dev);
  }
  for (const TestAmplitude& s : amplitudes) {
    const double z = (s.amplitude - weighted / weights) / s.std_dev;
    spread += z * z;
  }
  const std::size_t freedom = amplitudes.size() - 1;
  return chiSquareTail(spread, freedom + freedom % 2) <= SIGNIFICANT;
}

// Correlation of the amplitudes with a condition; 0 if one of them is constant.
double correlation(const std::vector<TestAmplitude>& amplitudes, const Condition& condition) {
  const double n = static_cast<double>(amplitudes.size());
  std::vector<double> x;
  double my = 0.0;
  for (const TestAmplitude& s : amplitudes) {
    x.push_back(condition.of(s.test->test));
    my += s.amplitude / n;
  }
  const double mx = std::accumulate(x.begin(), x.end(), 0.0) / n;
  double xx = 0.0, yy = 0.0, xy = 0.0;
  for (std::size_t k = 0; k < amplitudes.size(); ++k) {
    const double dx = x[k] - mx, dy = amplitudes[k].amplitude - my;
    xx += dx * dx;
    yy += dy * dy;
    xy += dx * dy;
  }
  return xx > 0.0 && yy > 0.0 ? std::abs(xy) / std::sqrt(xx * yy) : 0.0;
}

}  // namespace

std::vector<std::string> dependentConditions(const std::vector<TestAmplitude>& amplitudes) {
  std::vector<TestAmplitude> cuts, rest, with_spindle;
  for (const TestAmplitude& s : amplitudes) {
    (s.test->test.kind == TestKind::cut ? cuts : rest).push_back(s);
    if (s.test->test.kind != TestKind::tap) with_spindle.push_back(s);
  }
  std::vector<std::string> names;
  if (!cuts.empty() && !rest.empty() && rmsAmplitude(rest) < LIMITS.air_share * rmsAmplitude(cuts))
    names.push_back("cutting");
  const bool among_cuts = cuts.size() >= LIMITS.min_tests;
  const std::vector<TestAmplitude>& chosen = among_cuts ? cuts : with_spindle;
  if (chosen.size() < LIMITS.min_tests || !differ(chosen)) return names;
  const std::vector<Condition> conditions = conditionsOf(among_cuts);
  std::vector<std::pair<double, std::string>> strengths;
  for (const Condition& c : conditions) {
    // Fisher's z of n tests, Bonferroni-corrected for the number of conditions.
    const double r = correlation(chosen, c);
    const double z = std::atanh(std::min(r, 0.999999)) *
                     std::sqrt(std::max(static_cast<double>(chosen.size()) - 3.0, 1.0));
    if (2.0 * normalCdf(-z) * static_cast<double>(conditions.size()) < LIMITS.chance)
      strengths.emplace_back(-r, c.name);
  }
  std::sort(strengths.begin(), strengths.end());
  for (const auto& s : strengths) names.push_back(s.second);
  return names;
}

}  // namespace smartmill::discrepancy
