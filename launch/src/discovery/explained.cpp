#include "smartmill_launch/discovery/explained.h"

#include <cmath>
#include <fstream>
#include <utility>

#include <nlohmann/json.hpp>

#include "session/shown.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::discovery {
namespace {

using Json = nlohmann::ordered_json;

constexpr double SHOWS_NOTHING = 1.05;  // [1] gap; by chance it varies by some hundredths
constexpr double BETTER = 0.98;         // [1] of the gap, from which on another model is worth having
constexpr double SAME_ANGLE = 1e-3;     // [rad]

Explained::Effect effectOf(const Json& json) {
  Explained::Effect effect;
  effect.name = json.at("name");
  // A cause without a name is told by where it acts and its form.
  for (const char* key : {"stage", "form"}) {
    if (json.contains(key)) effect.parameters.push_back({key, 0.0, 0.0, json.at(key)});
  }
  for (ReportedParameter& p : reportedParameters(json.at("parameters")))
    effect.parameters.push_back(std::move(p));
  return effect;
}

Explained::Wanted wantedOf(const Json& report) {
  const Json& json = report.at("suggested_cut");
  Explained::Wanted wanted;
  wanted.text = report.at("suggested_test");
  wanted.cut = json.at("kind") == "cut";
  wanted.speed = units::radPerSecFromRpm(json.at("spindle_speed_rpm"));
  if (!wanted.cut) return wanted;
  wanted.engagement.feed_per_tooth = units::MM * json.at("feed_per_tooth_mm").get<double>();
  wanted.engagement.axial_depth = units::MM * json.at("axial_depth_mm").get<double>();
  wanted.engagement.entry = units::radFromDeg(json.at("entry_deg"));
  wanted.engagement.exit = units::radFromDeg(json.at("exit_deg"));
  return wanted;
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
  if (report.contains("suggested_cut")) e.wanted = wantedOf(report);
  const Json& gap = report.at("gap");
  const auto number = [&gap](const char* when, const char* over) {
    return gap.at(when).at(over).get<double>();
  };
  // Of few tests none is held out (0), or one in air, which shows nothing.
  const char* const over = number("before", "heldout") > SHOWS_NOTHING ? "heldout" : "fit";
  e.gap_before = number("before", over);
  e.gap_after = number("after", over);
  e.better = number("after", "fit") < BETTER * number("before", "fit") &&
             number("after", "heldout") <= SHOWS_NOTHING * number("before", "heldout");
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

session::PlannedCut planWanted(const session::CutPlanner& planner, const Explained::Wanted& wanted,
                               const session::SlotWish& frame, double air_time) {
  if (!wanted.cut) {
    session::PlannedCut air = planner.air(wanted.speed, air_time);
    air.condition.name = frame.name;
    return air;
  }
  const Engagement& e = wanted.engagement;
  if (e.entry > SAME_ANGLE || std::abs(e.exit - units::PI) > SAME_ANGLE) {
    throw Error(frame.name + ": from " + session::shown(units::degFromRad(e.entry), 0) + " to " +
                session::shown(units::degFromRad(e.exit), 0) + " deg, only full slots are cut here");
  }
  session::SlotWish wish = frame;
  planner.needLanes(wish.lane + 1, "the next slot's place is used up");
  wish.speed = wanted.speed;
  wish.depth = e.axial_depth;
  wish.feed_per_tooth = e.feed_per_tooth;
  return planner.slot(wish);
}

}  // namespace smartmill::discovery
