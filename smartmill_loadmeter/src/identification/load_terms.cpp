#include "load_terms.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "smartmill_core/error.h"
#include "smartmill_loadmeter/identification/torque_sensitivity.h"

namespace smartmill::loadmeter {

std::size_t LoadTerms::count() const {
  return friction().unknowns() + 2 + (growth ? 1 : 0) + (runout ? 2 : 0) + (lag ? 1 : 0);
}

LoadPlan::LoadPlan(const std::vector<LoadRecord>& records, double friction_zero_below, bool timed,
                   bool transients, std::size_t least_feeds, const std::string& where)
    : is_timed(timed), has_transients(transients) {
  std::set<double> speeds, ages;
  std::set<long> chips;
  slowest = fastest = records.empty() ? 0.0 : records.front().speed;
  for (const LoadRecord& r : records) {
    slowest = std::min(slowest, r.speed);
    fastest = std::max(fastest, r.speed);
    if (r.cut) {
      ++cuts;
      ages.insert(r.edge_age);
      has_teeth = has_teeth || r.tool.teeth > 1;
      has_angle = has_angle || (r.has_angle && r.tool.teeth > 1);
      const TorqueSensitivity torque = torqueSensitivity(r.tool, r.engagement);
      chips.insert(std::lround(1e9 * torque.tc / torque.te));
    } else {
      ++air_cuts;
      if (r.speed >= friction_zero_below) speeds.insert(r.speed);
    }
  }
  air_speeds = speeds.size();
  edge_ages = ages.size();
  // Readings of one commanded speed differ slightly.
  if (air_cuts > 0 && (speeds.empty() || !(*speeds.rbegin() > 1.05 * *speeds.begin()))) {
    throw Error(where + "friction: expected air cuts at two or more speeds, " + std::to_string(air_speeds) +
                " usable");
  }
  if (chips.size() < least_feeds) {
    throw Error(where + "coefficients from torque: " + std::to_string(cuts) + " cuts at " +
                std::to_string(chips.size()) + " different feeds, expected " +
                std::string(least_feeds == 3 ? "three" : std::to_string(least_feeds)) + " or more feeds");
  }
}

const std::vector<FurtherTerm>& furtherTerms() {
  static const std::vector<FurtherTerm> terms{
      {"Stribeck friction", &LoadTerms::stribeck, [](const LoadPlan& p) { return p.air_speeds >= 4; }},
      {"friction warm-up", &LoadTerms::warmup, [](const LoadPlan& p) { return p.is_timed; }},
      {"edge growth", &LoadTerms::growth, [](const LoadPlan& p) { return p.edge_ages >= 3; }},
      {"runout", &LoadTerms::runout, [](const LoadPlan& p) { return p.has_angle; }, true},
      {"load-meter lag", &LoadTerms::lag, [](const LoadPlan& p) { return p.has_transients; }}};
  return terms;
}

}  // namespace smartmill::loadmeter
