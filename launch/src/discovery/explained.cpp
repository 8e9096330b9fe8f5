#include "smartmill_launch/discovery/explained.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <utility>

#include <nlohmann/json.hpp>

#include "session/number_text.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::discovery {
namespace {

using Json = nlohmann::ordered_json;

constexpr double NO_DISAGREEMENT = 1.05;  // [1] gap; by chance it varies by some hundredths
constexpr double BETTER = 0.98;           // [1] of the gap, below which another model is an improvement
constexpr double SAME_ANGLE = 1e-3;       // [rad]

Explained::Effect effectOf(const Json& json) {
  Explained::Effect effect;
  effect.name = json.at("name");
  // An empirical residual model is described by its stage and form.
  for (const char* key : {"stage", "form"}) {
    if (json.contains(key)) effect.parameters.push_back({key, 0.0, 0.0, json.at(key)});
  }
  for (ReportedParameter& p : reportedParameters(json.at("parameters")))
    effect.parameters.push_back(std::move(p));
  return effect;
}

Explained::SuggestedTest suggestedTestOf(const Json& report) {
  const Json& json = report.at("suggested_cut");
  Explained::SuggestedTest suggested_test;
  suggested_test.text = report.at("suggested_test");
  suggested_test.cut = json.at("kind") == "cut";
  suggested_test.speed = units::radPerSecFromRpm(json.at("spindle_speed_rpm"));
  if (!suggested_test.cut) return suggested_test;
  suggested_test.engagement.feed_per_tooth = units::MM * json.at("feed_per_tooth_mm").get<double>();
  suggested_test.engagement.axial_depth = units::MM * json.at("axial_depth_mm").get<double>();
  suggested_test.engagement.entry = units::radFromDeg(json.at("entry_deg"));
  suggested_test.engagement.exit = units::radFromDeg(json.at("exit_deg"));
  return suggested_test;
}

Explained explainedOf(const Json& report) {
  Explained e;
  e.verdict = report.at("verdict");
  for (const Json& effect : report.at("effects")) e.effects.push_back(effectOf(effect));
  for (const Json& pair : report.at("not_separable")) {
    std::string text;
    for (const Json& name : pair) text += (text.empty() ? "" : " or ") + name.get<std::string>();
    e.rivals.push_back(text);
  }
  if (report.contains("suggested_cut")) e.suggested_test = suggestedTestOf(report);
  const Json& gap = report.at("gap");
  const auto number = [&gap](const char* when, const char* tests) {
    return gap.at(when).at(tests).get<double>();
  };
  // With few tests none is held out (gap 0), or only an air cut, which shows no disagreement.
  const char* const tests = number("before", "heldout") > NO_DISAGREEMENT ? "heldout" : "fit";
  e.gap_before = number("before", tests);
  e.gap_after = number("after", tests);
  e.better = number("after", "fit") < BETTER * number("before", "fit") &&
             number("after", "heldout") <= NO_DISAGREEMENT * number("before", "heldout");
  return e;
}

}  // namespace

std::string Explained::Effect::text() const {
  return name + ":" + (parameters.empty() ? "" : " " + textOf(parameters));
}

Explained readExplained(const std::string& file) {
  std::ifstream in(file);
  if (!in) throw Error(file + ": cannot be read");
  try {
    return explainedOf(Json::parse(in));
  } catch (const Json::exception& error) {
    throw Error(file + ": " + error.what());
  }
}

session::PlannedCut planSuggestedTest(const session::CutPlanner& planner,
                                      const Explained::SuggestedTest& suggested_test,
                                      const session::SlotRequest& slot, double air_time,
                                      const BelievedLimits& limits) {
  if (!suggested_test.cut) {
    session::PlannedCut air = planner.air(suggested_test.speed, air_time);
    air.condition.name = slot.name;
    return air;
  }
  const Engagement& e = suggested_test.engagement;
  if (e.entry > SAME_ANGLE || std::abs(e.exit - units::PI) > SAME_ANGLE) {
    throw Error(slot.name + ": from " + session::numberText(units::degFromRad(e.entry), 0) + " to " +
                session::numberText(units::degFromRad(e.exit), 0) +
                " deg, expected a full slot (0 to 180 deg)");
  }
  session::SlotRequest request = slot;
  planner.requireLanes(request.lane + 1, "no lane is left for the suggested test");
  request.speed = suggested_test.speed;
  request.depth = std::min(e.axial_depth, limits.depthAt(request.speed));
  request.feed_per_tooth = e.feed_per_tooth;
  return planner.slot(request);
}

}  // namespace smartmill::discovery
