#include "smartmill_discrepancy/report/report_json.h"

#include <cmath>
#include <fstream>

#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

using Json = nlohmann::ordered_json;

double rounded(double value) {
  if (value == 0.0 || !std::isfinite(value)) return 0.0;
  const double scale = std::pow(10.0, 8.0 - std::floor(std::log10(std::abs(value))));
  return std::isfinite(scale) && scale > 0.0 ? std::round(value * scale) / scale : value;
}

Json findingsOf(const std::vector<Finding>& findings) {
  Json list = Json::array();
  for (const Finding& f : findings) {
    Json location = Json::object();
    for (const auto& [key, value] : f.location) location[key] = rounded(value);
    list.push_back({{"channel", f.channel},
                    {"tests", f.tests},
                    {"domain", f.domain},
                    {"location", location},
                    {"depends_on", f.depends_on},
                    {"share_of_gap", rounded(f.share_of_gap)},
                    {"p_value", f.p_value},
                    {"amplitude", rounded(f.amplitude)}});
  }
  return list;
}

Json sharesOf(const std::vector<ChannelShare>& channels) {
  Json list = Json::array();
  for (const ChannelShare& c : channels) {
    Json share = {{"channel", c.channel},
                  {"explained_before", rounded(c.explained_before)},
                  {"explained_after", rounded(c.explained_after)}};
    if (c.synchronous_share) {
      share["repeats"] = rounded(*c.synchronous_share);
      share["floor"] = rounded(c.floor);
      share["floor_gap"] = rounded(c.floor_gap);
    }
    list.push_back(share);
  }
  return list;
}

// With the keys of a campaign's tests.
Json cutOf(const CampaignTest& test) {
  Json cut = {{"kind", test.engagement ? "cut" : "air"},
              {"spindle_speed_rpm", rounded(units::rpmFromRadPerSec(test.spindle_speed))}};
  if (!test.engagement) return cut;
  const Engagement& e = *test.engagement;
  cut["feed_per_tooth_mm"] = rounded(e.feed_per_tooth / units::MM);
  cut["axial_depth_mm"] = rounded(e.axial_depth / units::MM);
  cut["entry_deg"] = rounded(units::degFromRad(e.entry));
  cut["exit_deg"] = rounded(units::degFromRad(e.exit));
  if (test.feed_direction != 0.0) cut["feed_direction_deg"] = rounded(units::degFromRad(test.feed_direction));
  return cut;
}

Json effectsOf(const std::vector<FoundEffect>& effects) {
  Json list = Json::array();
  for (const FoundEffect& effect : effects) {
    Json parameters = Json::object();
    for (const FoundParameter& p : effect.parameters) {
      parameters[p.key] = {{"value", rounded(p.known())}, {"std", rounded(p.std_dev)}};
      if (p.modulo > 0.0) parameters[p.key]["modulo"] = rounded(p.modulo);
    }
    for (const auto& [key, word] : effect.words) parameters[key] = {{"value", word}};
    Json alternatives = Json::array();
    for (const Rival& rival : effect.alternatives)
      alternatives.push_back({{"name", rival.name}, {"delta_bic", rounded(rival.delta_bic)}});
    Json entry = {{"name", effect.name}};
    if (const EffectKind* kind = findEffect(effect.name); kind && kind->empirical())
      entry = {{"name", EMPIRICAL}, {"stage", kind->form_stage}, {"form", kind->form}};
    entry.update({{"parameters", parameters},
                  {"delta_bic", rounded(effect.delta_bic)},
                  {"heldout_gap_reduction", rounded(effect.heldout_gap_reduction)},
                  {"confidence", rounded(effect.confidence)},
                  {"alternatives", alternatives}});
    list.push_back(entry);
  }
  return list;
}

}  // namespace

void writeReport(const Explanation& e, const std::string& folder) {
  Json report;
  report["format"] = "smartmill-report/2";
  report["verdict"] = nameOf(e.verdict);
  report["where"] = findingsOf(e.where);
  report["effects"] = effectsOf(e.effects);
  for (const InspectedDimension& d : e.inspection.dimensions) {
    report["inspection"].push_back({{"test", d.test},
                                    {"kind", d.kind},
                                    {"direction", d.direction},
                                    {"measured_um", rounded(d.measured / units::UM)},
                                    {"std_um", rounded(d.std_dev / units::UM)},
                                    {"before_um", rounded(d.before / units::UM)},
                                    {"after_um", rounded(d.after / units::UM)}});
  }
  if (e.verdict == Verdict::recalibrated) {
    report["recalibrated"] = Json::array();
    for (const RecalibratedValue& v : e.recalibrated)
      report["recalibrated"].push_back({{"name", v.name},
                                        {"before", rounded(v.before)},
                                        {"after", rounded(v.after)},
                                        {"std", rounded(v.std_dev)},
                                        {"deviations", rounded(v.deviations)}});
  }
  report["resembles"] = Json::array();
  for (const Resemblance& r : e.resembles)
    report["resembles"].push_back({{"name", r.name}, {"variant", r.variant}, {"reason", r.reason}});
  report["not_separable"] = e.not_separable;
  report["suggested_test"] = e.suggested_test ? Json(*e.suggested_test) : Json(nullptr);
  if (e.suggested_cut) report["suggested_cut"] = cutOf(*e.suggested_cut);
  report["unexplained"] = findingsOf(e.unexplained);
  report["gap"] = {{"before", {{"fit", rounded(e.before.fit)}, {"heldout", rounded(e.before.heldout)}}},
                   {"after", {{"fit", rounded(e.after.fit)}, {"heldout", rounded(e.after.heldout)}}}};
  if (e.named_only)
    report["gap"]["without_empirical"] = {{"fit", rounded(e.named_only->fit)},
                                          {"heldout", rounded(e.named_only->heldout)}};
  if (!e.sentence.empty()) report["sentence"] = e.sentence;
  report["gaps"] = Json::array();
  for (const TestGap& g : e.gaps) {
    report["gaps"].push_back(
        {{"test", g.test},
         {"channel", g.channel},
         {"heldout", g.heldout},
         {"before", rounded(g.before)},
         {"after", rounded(g.after)},
         {"interval", {rounded(g.after - 1.96 * g.std_dev), rounded(g.after + 1.96 * g.std_dev)}}});
  }
  report["channels"] = sharesOf(e.channels);
  for (const ChannelShare& c : e.channels) {
    if (c.explained_heldout) report["explained_share"][c.channel] = rounded(*c.explained_heldout);
    if (c.synchronous_share) report["repeatability_floor"][c.channel] = rounded(c.floor);
  }
  for (const ChatteringCut& c : e.chattering) {
    report["chattering"].push_back(
        {{"test", c.test},
         {"frequency_hz", rounded(c.frequency)},
         {"amplitude", rounded(c.amplitude)},
         {"prediction_error", {{"before", rounded(c.before)}, {"after", rounded(c.after)}}}});
  }
  report["candidates"] = Json::array();
  for (const CandidateResult& t : e.candidates) {
    report["candidates"].push_back({{"round", t.round + 1},
                                    {"name", t.effect},
                                    {"variant", t.variant},
                                    {"promised", rounded(t.predicted_gain)},
                                    {"delta_bic", rounded(t.delta_bic)},
                                    {"taken", t.accepted},
                                    {"simulations", t.simulations},
                                    {"seconds", rounded(t.seconds)}});
  }
  std::vector<std::string> notes = e.notes;
  notes.insert(notes.end(), e.stream_shifts.begin(), e.stream_shifts.end());
  for (const Untestable& one : e.untestable) notes.push_back(one.effect + " is not tested: " + one.reason);
  report["notes"] = notes;
  if (e.interrupted) report["interrupted"] = true;
  if (e.spent_budget) report["spent_budget_s"] = rounded(*e.spent_budget);
  if (!e.not_tried.empty()) report["not_tried"] = e.not_tried;
  report["seconds"] = rounded(e.seconds);
  const std::string file = folder + "/report.json";
  std::ofstream out(file);
  out << report.dump(1) << "\n";
  if (!out) throw Error(file + ": cannot be written");
}

}  // namespace smartmill::discrepancy
