#include "smartmill_loadmeter/database/find_coefficients.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_loadmeter/database/recommend.h"
#include "smartmill_loadmeter/identification/production.h"
#include "smartmill_loadmeter/identification/session_identification.h"

namespace smartmill::loadmeter {

namespace {

constexpr double WIDER = 2.0;  // [1] of the covered feeds and speeds, for the next test

TorqueCovariance torqueCovarianceOf(const CoefficientRecord& r) {
  const double stored = r.covariance[CoefficientRecord::covarianceIndex(0, 3)];
  return {std::pow(r.set.std_dev.ktc, 2), std::isfinite(stored) ? stored : 0.0,
          std::pow(r.set.std_dev.kte, 2)};
}

bool isComplete(const CoefficientRecord& r) {
  return r.set.value.ktc > 0.0 && r.set.value.kte > 0.0 && r.set.std_dev.ktc > 0.0 && r.set.std_dev.kte > 0.0;
}

void suggestNext(const CoefficientKnowledge& known, const MachineModel& model, FoundCoefficients* found) {
  const CoefficientRecord& r = known.combined;
  if (!model.spindle || !model.tool || !isComplete(r) || !(known.cutting_speed.low > 0.0) ||
      !(known.feed_per_tooth.low > 0.0) || !(known.axial_depth.low > 0.0))
    return;
  ToolGeometry tool = *model.tool;
  tool.pitch.clear();
  if (r.teeth > 0) tool.teeth = r.teeth;
  if (r.diameter > 0.0) tool.diameter = r.diameter;
  if (std::isfinite(r.helix)) tool.helix = r.helix;
  SuggestionLimits limits;
  const double top = model.spindle->max_speed.value_or(INFINITY);
  limits.slowest = std::min(top, known.cutting_speed.low / tool.radius() / WIDER);
  limits.fastest = std::min(top, known.cutting_speed.high / tool.radius() * WIDER);
  limits.least_feed = known.feed_per_tooth.low / WIDER;
  limits.most_feed = known.feed_per_tooth.high * WIDER;
  // Not deeper than before: the stability limit is unknown here.
  limits.least_depth = known.axial_depth.low;
  limits.most_depth = known.axial_depth.high;
  limits.torque = model.spindle->rated_torque.value_or(0.0);
  limits.power = model.spindle->rated_power.value_or(0.0);
  found->next = mostInformativeCut(tool, *model.spindle, r.set.value, torqueCovarianceOf(r), limits);
  if (!found->next) return;
  CuttingCondition& next = found->next_condition;
  next.kind = CuttingCondition::Kind::cut;
  next.name = "next_test";
  next.tool_name = r.set.tool;
  next.material = r.set.material;
  next.tool = tool;
  next.engagement = found->next->engagement;
  next.spindle_speed = found->next->speed;
}

void findNeeded(const std::vector<CuttingCondition>& tests, const MachineModel& model,
                FoundCoefficients* found) {
  found->needed.resize(tests.size());
  std::iota(found->needed.begin(), found->needed.end(), 0);
  if (tests.empty() || !model.spindle) return;
  if (found->known && found->known->identifications > 0 && isComplete(found->known->combined))
    found->needed = neededTests(tests, *model.spindle, torqueCovarianceOf(found->known->combined));
}

}  // namespace

FoundCoefficients findCoefficients(const CoefficientDatabase& database, const std::string& tool,
                                   const std::string& material, const std::vector<CuttingCondition>& tests,
                                   const MachineModel& model) {
  FoundCoefficients found;
  found.known = knowledgeOf(database, tool, material);
  findNeeded(tests, model, &found);
  if (found.known) {
    const CoefficientKnowledge& k = *found.known;
    found.message = k.identifications > 0
                        ? "source " + k.combined.set.source + ", " +
                              countOf(static_cast<std::size_t>(k.combined.set.tests), "test") + " in " +
                              countOf(static_cast<std::size_t>(k.identifications), "identification")
                        : countOf(static_cast<std::size_t>(k.production_cuts), "cut") + " combined";
    if (k.superseded > 0)
      found.message += formatted("; %d older ones disagree and are not used", k.superseded);
    suggestNext(k, model, &found);
    return found;
  }
  CoefficientQuery query;
  query.tool = tool;
  query.material = material;
  if (model.tool) {
    query.diameter = model.tool->diameter;
    query.helix = model.tool->helix;
  }
  const auto predicted = tool.empty() || material.empty() ? std::nullopt : recommendCut(database, query);
  if (predicted) {
    found.predicted = predicted->set;
    found.message = "no records with '" + tool + "': " + predicted->message;
    return found;
  }
  found.message = "no records for '" + tool + "' in '" + material + "'; known: " + database.contents();
  return found;
}

CutChoice chooseCuts(const FoundCoefficients& found, const CutChoiceRequest& request,
                     const std::vector<LoadTest>& air_cuts, double settling, const MachineModel& model) {
  const Spindle& spindle = model.needSpindle("choose cuts");
  const LoadMeterReadings readings = readingsOf(air_cuts, spindle, settling);
  const bool stored = !request.without_stored && found.known && found.known->identifications > 0 &&
                      isComplete(found.known->combined);
  const TorqueCovariance start = stored ? torqueCovarianceOf(found.known->combined) : withoutKnowledge();
  ChoiceGoal goal;
  CutInformation known;
  known.addKnowledge(start);
  std::set<double> air_speeds;
  for (const CuttingCondition& test : request.made) {
    const bool cut = test.kind == CuttingCondition::Kind::cut;
    known.addTest(test, spindle, readings.voltageStd(cut ? steadyTime(test) - settling : readings.air_time));
    if (cut) {
      goal.feeds_made.push_back(test.engagement.feed_per_tooth);
    } else {
      air_speeds.insert(test.spindle_speed);
    }
  }
  if (air_speeds.size() < 2) {
    throw Error(
        formatted("tests: air cuts at %zu speeds, expected two or more for the friction of the spindle",
                  air_speeds.size()));
  }
  const RecursiveCoefficients::Start metal;
  goal.highest.ktc = (stored ? found.known->combined.set.value.ktc : metal.ktc) + std::sqrt(start.tc);
  goal.highest.kte = (stored ? found.known->combined.set.value.kte : metal.kte) + std::sqrt(start.te);
  goal.ktc_std = request.ktc_std;
  goal.kte_std = request.kte_std;
  goal.stock = request.stock;
  goal.torque = spindle.rated_torque.value_or(0.0);
  goal.power = spindle.rated_power.value_or(0.0);
  goal.least_feeds = stored ? 2 : 3;
  return chooseCuts(known, request.candidates, readings, spindle, goal);
}

}  // namespace smartmill::loadmeter
