#include <algorithm>
#include <cmath>
#include <sstream>
#include <tuple>

#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_launch/report/session_report.h"

namespace smartmill::report {
namespace {

using Json = nlohmann::ordered_json;
using Row = std::vector<std::string>;

std::string cell(const char* format, double value) {
  if (std::isnan(value)) return "-";
  return formatted(format, value);
}

/// NaN: absent or null.
double numberAt(const Json& object, const std::string& key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? found->get<double>() : NOT_A_NUMBER;
}

std::string aligned(const std::vector<Row>& rows) {
  std::vector<std::size_t> width(rows[0].size(), 0);
  for (const Row& row : rows) {
    for (std::size_t c = 0; c < row.size(); ++c) width[c] = std::max(width[c], row[c].size());
  }
  std::string text;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t c = 0; c < width.size(); ++c) {
      const std::string padding(width[c] - rows[r][c].size(), ' ');
      text += c == 0 ? "| " + rows[r][c] + padding : " | " + padding + rows[r][c];
    }
    text += " |\n";
    if (r > 0) continue;
    for (std::size_t c = 0; c < width.size(); ++c) {
      text += "|" + std::string(width[c] + 1, '-') + (c == 0 ? "-" : ":");
    }
    text += "|\n";
  }
  return text;
}

std::string verdictOf(const Figure& figure) {
  if (figure.unchecked) return "NOT CHECKED";
  const std::optional<bool> met = figure.met();
  return !met ? "" : *met ? "met" : "MISSED";
}

std::string targetText(const Target& target) {
  if (std::isnan(target.percent)) return "";
  return cell(target.at_least ? ">= %.1f %%" : "<= %.1f %%", target.percent);
}

/// JSON has neither NaN nor infinity.
Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json parsed(const std::string& session) {
  try {
    return Json::parse(session);
  } catch (const Json::exception&) {
    throw Error("summary of the session: expected JSON");
  }
}

}  // namespace

std::string markdown(const Report& report) {
  std::ostringstream out;
  out << "# Session\n";
  for (const Section& section : report.sections) {
    std::vector<Row> rows{
        {"quantity", "unit", "measured", "std", "true", "diff %", "diff/std", "target", "verdict"}};
    for (const Figure& f : section.figures) {
      rows.push_back({f.name, f.unit, cell("%.6g", f.estimate), cell("%.2g", f.std_dev),
                      cell("%.6g", f.truth), cell("%+.3f", f.percent()), cell("%+.2f", f.sigmas()),
                      targetText(f.target), verdictOf(f)});
    }
    out << "\n## " << section.title << "\n\n" << aligned(rows);
  }
  if (!report.cuts.empty()) {
    std::vector<Row> rows{{"cut", "rpm", "depth mm", "chart's limit mm", "true limit mm", "predicted",
                           "detected", "windows", "chatter Hz", "non-periodic share of true force",
                           "verdict"}};
    for (const CutCheck& cut : report.cuts) {
      rows.push_back(
          {cut.name, cell("%.0f", units::rpmFromRadPerSec(cut.spindle_speed)),
           cell("%.3f", cut.axial_depth / units::MM), cell("%.3f", cut.limit / units::MM),
           cell("%.3f", cut.true_limit / units::MM), wordOf(cut.predicted), wordOf(cut.verdict.kind),
           std::to_string(cut.verdict.chattering) + " of " + std::to_string(cut.verdict.windows),
           cell("%.1f", cut.verdict.frequency), cell("%.4f", cut.nonperiodic), cut.met() ? "met" : "MISSED"});
    }
    out << "\n## Cuts that verify the chart\n\n" << aligned(rows);
  }
  out << "\n";
  for (const std::string& note : report.notes) out << "- " << note << "\n";
  for (const std::string& result : report.unchecked) out << "- NOT CHECKED: " << result << "\n";
  out << "\n" << report.met() << " of " << report.targets() << " targets met\n";
  return out.str();
}

std::vector<std::string> notMeasured(const SessionRecording& recording, const std::string& session) {
  std::vector<std::string> missing;
  if (session.empty()) return missing;
  const Json summary = parsed(session);
  for (const Json& step : summary.value("steps", Json::array())) {
    if (!step.value("done", false))
      missing.push_back("step '" + step.value("name", "") + "' failed: " + step.value("detail", ""));
  }
  if (missing.empty()) return missing;
  const auto require = [&](bool present, const std::string& name) {
    if (!present) missing.push_back(name + ": not in the recording");
  };
  require(recording.coefficients.has_value(), "cutting coefficients");
  require(recording.modal(false, POINT_TOOL_TIP, "x"), "tool-tip modes in x");
  require(recording.modal(false, POINT_TOOL_TIP, "y"), "tool-tip modes in y");
  require(recording.chart.has_value(), "stability chart");
  for (const char* cut : {"verify_stable", "verify_unstable", "resonance"})
    require(recording.cut(cut), std::string("cut ") + cut);
  return missing;
}

std::vector<std::string> testPlanNotes(const std::string& session) {
  if (session.empty()) return {};
  const Json summary = parsed(session);
  const Json plan = summary.value("test_plan", Json::object());
  if (plan.value("planned_tests", 0) == 0) return {};
  const int tests = plan.value("made_tests", 0), planned = plan.value("planned_tests", 0);
  const int cuts = plan.value("made_cuts", 0), planned_cuts = plan.value("planned_cuts", 0);
  const double saved = plan.value("planned_time_s", 0.0) - plan.value("made_time_s", 0.0);
  std::vector<std::string> notes{
      formatted(
          "test plan: %d of %d cuts and %d of %d air cuts, %.2f of %.2f min (%d tests and %.2f min fewer); "
          "database: ",
          cuts, planned_cuts, tests - cuts, planned - planned_cuts, plan.value("made_time_s", 0.0) / 60.0,
          plan.value("planned_time_s", 0.0) / 60.0, planned - tests, saved / 60.0) +
      plan.value("stored", "")};
  std::string chosen;
  for (const Json& cut : plan.value("chosen_cuts", Json::array())) {
    chosen += (chosen.empty() ? "cuts by their information per second of cutting: " : ", ") +
              cut.value("name", "") + formatted(" (%.2f)", numberAt(cut, "information_per_s"));
  }
  if (!chosen.empty()) notes.push_back(chosen);
  const Json known = plan.value("stored_coefficients", Json::array());
  const Json found = summary.value("coefficients", Json::array());
  if (known.empty() || found.empty()) return notes;
  for (const auto& [key, name, unit, text] : {std::tuple{"ktc_n_per_m2", "Ktc", units::N_PER_MM2, "N/mm2"},
                                              std::tuple{"kte_n_per_m", "Kte", units::N_PER_MM, "N/mm"}}) {
    const std::string std_key = std::string(key) + "_std";
    const double before = numberAt(known[0], key), before_std = numberAt(known[0], std_key);
    const double now = numberAt(found[0], key), now_std = numberAt(found[0], std_key);
    // The new value contains the stored one, so that the variance of their difference is that of the
    // variances; without it they are independent.
    const double variance =
        before_std * before_std + (plan.value("stored_used", false) ? -1.0 : 1.0) * now_std * now_std;
    notes.push_back(
        formatted("%s: stored %.2f +- %.2f %s, now %.2f +- %.2f %s, difference %.1f standard deviations%s",
                  name, before / unit, before_std / unit, text, now / unit, now_std / unit, text,
                  std::abs(now - before) / std::sqrt(variance),
                  plan.value("stored_used", false)
                      ? ""
                      : "; the tests disagree with the stored values, which are not used"));
  }
  return notes;
}

std::string json(const Report& report, const std::string& session) {
  Json out;
  out["targets"] = report.targets();
  out["targets_met"] = report.met();
  out["figures"] = Json::array();
  for (const Section& section : report.sections) {
    for (const Figure& f : section.figures) {
      Json figure{{"section", section.title},
                  {"quantity", f.name},
                  {"unit", f.unit},
                  {"measured", number(f.estimate)},
                  {"std", number(f.std_dev)},
                  {"true", number(f.truth)},
                  {"difference_percent", number(f.percent())},
                  {"difference_over_std", number(f.sigmas())}};
      if (std::isfinite(f.target.percent)) {
        figure[f.target.at_least ? "at_least_percent" : "at_most_percent"] = f.target.percent;
      }
      if (const auto met = f.met()) figure["met"] = *met;
      if (f.unchecked) figure["met"] = nullptr;
      out["figures"].push_back(figure);
    }
  }
  out["cuts"] = Json::array();
  for (const CutCheck& cut : report.cuts) {
    out["cuts"].push_back({{"name", cut.name},
                           {"spindle_speed_rad_per_s", cut.spindle_speed},
                           {"axial_depth_m", cut.axial_depth},
                           {"depth_limit_m", number(cut.limit)},
                           {"true_depth_limit_m", number(cut.true_limit)},
                           {"chart_says", wordOf(cut.predicted)},
                           {"detector_says", wordOf(cut.verdict.kind)},
                           {"windows", cut.verdict.windows},
                           {"chattering_windows", cut.verdict.chattering},
                           {"chatter_frequency_hz", number(cut.verdict.frequency)},
                           {"nonperiodic_share_of_true_force", number(cut.nonperiodic)},
                           {"met", cut.met()}});
  }
  out["notes"] = report.notes;
  out["unchecked"] = report.unchecked;
  if (!session.empty()) out["session"] = parsed(session);
  return out.dump(2) + "\n";
}

}  // namespace smartmill::report
