#include "session_summary.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"

namespace smartmill::session {
namespace {

using Json = nlohmann::ordered_json;

/// JSON has neither NaN nor infinity.
Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json modesOf(const MeasuredModes& measured) {
  Json modes = Json::array();
  for (const Mode& mode : measured.model.modes) {
    modes.push_back({{"frequency_hz", number(mode.frequency)},
                     {"frequency_hz_std", number(mode.frequency_std)},
                     {"damping_ratio", number(mode.damping_ratio)},
                     {"damping_ratio_std", number(mode.damping_ratio_std)},
                     {"gain", number(mode.gain)},
                     {"gain_std", number(mode.gain_std)}});
  }
  return {{"point", measured.point},
          {"direction", measured.direction},
          {"unit", measured.unit},
          {"modes", modes}};
}

Json coefficientsOf(const CoefficientSet& set) {
  return {{"ktc_n_per_m2", number(set.value.ktc)},
          {"ktc_n_per_m2_std", number(set.std_dev.ktc)},
          {"kte_n_per_m", number(set.value.kte)},
          {"kte_n_per_m_std", number(set.std_dev.kte)},
          {"friction_viscous_nm_s_per_rad", number(set.friction_viscous)},
          {"friction_coulomb_nm", number(set.friction_coulomb)},
          {"source", set.source},
          {"tests", set.tests}};
}

Json planOf(const SessionSummary::TestPlan& plan) {
  Json known = Json::array();
  for (const CoefficientSet& set : plan.known) known.push_back(coefficientsOf(set));
  Json chosen = Json::array();
  for (const SessionSummary::TestPlan::Chosen& cut : plan.chosen) {
    chosen.push_back({{"name", cut.name},
                      {"information_per_s", number(cut.gain)},
                      {"expected_ktc_n_per_m2_std", number(cut.ktc_std)},
                      {"expected_kte_n_per_m_std", number(cut.kte_std)}});
  }
  Json json{{"planned_tests", plan.planned},
            {"made_tests", plan.made},
            {"planned_cuts", plan.planned_cuts},
            {"made_cuts", plan.made_cuts},
            {"planned_time_s", plan.planned_time},
            {"made_time_s", plan.made_time},
            {"stored", plan.stored},
            {"stored_coefficients", known},
            {"stored_used", plan.used}};
  if (plan.chosen.empty()) return json;
  json["chosen_cuts"] = chosen;
  json["target_reached"] = plan.target_reached;
  json["excluded_cuts"] = plan.excluded;
  return json;
}

/// Adds the elements of the interrupted session whose keys have no new element.
void addEarlier(const Json& before, const char* list, const std::vector<const char*>& keys, Json* json) {
  Json all = Json::array();
  for (const Json& old : before.at(list)) {
    const auto same = [&](const Json& now) {
      return std::all_of(keys.begin(), keys.end(), [&](const char* k) { return now.at(k) == old.at(k); });
    };
    const Json& now = json->at(list);
    if (std::none_of(now.begin(), now.end(), same)) all.push_back(old);
  }
  for (const Json& now : json->at(list)) all.push_back(now);
  (*json)[list] = all;
}

}  // namespace

std::string SessionSummary::TestPlan::text() const {
  if (!chosen.empty()) {
    return formatted("%zu cuts in place of %zu slots, %zu of %zu air cuts, %.2f min in place of %.2f min",
                     made_cuts, planned_cuts, made - made_cuts, planned - planned_cuts, made_time / 60.0,
                     planned_time / 60.0);
  }
  return formatted("%zu of %zu cuts, %zu of %zu air cuts, %.2f of %.2f min", made_cuts, planned_cuts,
                   made - made_cuts, planned - planned_cuts, made_time / 60.0, planned_time / 60.0);
}

std::string SessionSummary::text() const {
  Json json;
  json["completed"] = completed;
  json["tool"] = tool;
  json["material"] = material;
  json["steps"] = Json::array();
  for (const Step& step : steps) {
    json["steps"].push_back(
        {{"name", step.name}, {"elapsed_s", step.elapsed}, {"done", step.done}, {"detail", step.detail}});
  }
  json["modes"] = Json::array();
  for (const MeasuredModes& measured : modes) json["modes"].push_back(modesOf(measured));
  json["coefficients"] = Json::array();
  for (const CoefficientSet& set : coefficients) json["coefficients"].push_back(coefficientsOf(set));
  json["test_plan"] = planOf(test_plan);
  json["verified_cuts"] = Json::array();
  for (const Verified& cut : verified) {
    json["verified_cuts"].push_back({{"chart_says", cut.role},
                                     {"spindle_speed_rad_per_s", cut.spindle_speed},
                                     {"axial_depth_m", cut.axial_depth},
                                     {"depth_limit_m", number(cut.depth_limit)},
                                     {"cut_is", wordOf(cut.verdict.kind)},
                                     {"windows", cut.verdict.windows},
                                     {"chattering_windows", cut.verdict.chattering},
                                     {"chatter_frequency_hz", number(cut.verdict.frequency)},
                                     {"as_predicted", cut.as_predicted}});
  }
  if (!probing.empty()) json["probing_cuts"] = Json::array();
  for (const Probing& cut : probing) {
    json["probing_cuts"].push_back({{"name", cut.name},
                                    {"spindle_speed_rad_per_s", cut.spindle_speed},
                                    {"axial_depth_m", cut.axial_depth},
                                    {"probability_stable", number(cut.probability)},
                                    {"cut_is", wordOf(cut.verdict.kind)},
                                    {"windows", cut.verdict.windows},
                                    {"chattering_windows", cut.verdict.chattering},
                                    {"chatter_frequency_hz", number(cut.verdict.frequency)}});
  }
  if (recommended) {
    json["recommended_cut"] = {{"spindle_speed_rad_per_s", recommended->spindle_speed},
                               {"axial_depth_m", recommended->axial_depth},
                               {"probability_stable", number(recommended->probability)},
                               {"probability_stable_std", number(recommended->probability_std)}};
  }
  if (control) {
    json["controlled_cut"] = {{"suppressed", control->suppressed()},
                              {"chatter_frequency_hz", number(control->frequency)},
                              {"time_to_last_change_s", number(control->duration)},
                              {"speed_ratio", number(control->speed_ratio)},
                              {"feed_ratio", number(control->feed_ratio)},
                              {"cut_is_then", wordOf(control->after.kind)},
                              {"windows", control->after.windows},
                              {"chattering_windows", control->after.chattering}};
  }
  if (sensor) {
    const auto vector = [](const geometry_msgs::Vector3& v) {
      return Json{number(v.x), number(v.y), number(v.z)};
    };
    json["force_sensor"] = {{"sensor", sensor->sensor},
                            {"calibrated", sensor->calibrated != 0},
                            {"message", sensor->message},
                            {"readings", sensor->readings},
                            {"constant", vector(sensor->constant)},
                            {"constant_std", vector(sensor->constant_std)},
                            {"expected_error", vector(sensor->error)},
                            {"verified", sensor->verified != 0},
                            {"calibration_s", calibration_time}};
  }
  if (!before.empty()) {
    const Json earlier = Json::parse(before);
    addEarlier(earlier, "modes", {"point", "direction"}, &json);
    addEarlier(earlier, "verified_cuts", {"chart_says"}, &json);
    if (!control && earlier.contains("controlled_cut")) json["controlled_cut"] = earlier["controlled_cut"];
    if (coefficients.empty()) {
      json["coefficients"] = earlier.at("coefficients");
      json["test_plan"] = earlier.at("test_plan");
    }
  }
  return json.dump(2);
}

void SessionSummary::write(const std::string& file) const {
  std::ofstream out(file);
  out << text() << "\n";
  out.close();
  if (!out) throw Error(file + ": cannot be written");
}

}  // namespace smartmill::session
