#include "smartmill_launch/discovery/discovery_report.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"

namespace smartmill::discovery {
namespace {

// Rows of one effect: identified and true value of each key; a missing side is "-".
std::string rowsOf(const Explained::Effect* found, const EffectEntry* hidden) {
  const std::string name = found ? found->name : hidden->name;
  const EffectKind* kind = findEffect(name);
  std::string rows;
  const auto row = [&](const std::string& key, const std::string& a, const std::string& b,
                       const std::string& difference) {
    rows += "| " + name + " " + key + " | " + a + " | " + b + " | " + difference + " |\n";
  };
  const auto truths = hidden ? numbersOf(*hidden) : std::vector<std::pair<std::string, double>>();
  if (!found) {
    for (const auto& [key, truth] : truths) row(key, "-", formatted("%.5g", truth), "not named");
    return rows;
  }
  for (const ReportedParameter& p : found->parameters) {
    const auto at = std::find_if(truths.begin(), truths.end(),
                                 [&](const std::pair<std::string, double>& t) { return t.first == p.key; });
    if (!p.word.empty()) {
      const bool known = hidden && hidden->words.count(p.key) > 0;
      row(p.key, p.word, known ? hidden->words.at(p.key) : "-", "");
    } else if (at == truths.end()) {
      row(p.key, formatted("%.5g +- %.2g", p.value, p.std_dev), hidden ? "0" : "-",
          hidden ? "" : "not hidden");
    } else {
      const double difference =
          kind ? parameterOf(*kind, p.key).difference(p.value, at->second) : p.value - at->second;
      row(p.key, formatted("%.5g +- %.2g", p.value, p.std_dev), formatted("%.5g", at->second),
          p.std_dev > 0.0 ? formatted("%+.1f standard deviations", difference / p.std_dev) : "");
    }
  }
  return rows;
}

}  // namespace

DiscoveryReport reportOf(const Explained& explained, const std::vector<std::string>& tests,
                         const std::vector<EffectEntry>& hidden) {
  DiscoveryReport report;
  report.text =
      "| effect and parameter | identified | hidden in the machine | difference |\n|---|---|---|---|\n";
  std::size_t correct = 0;
  const auto isFound = [&](const EffectEntry& e) {
    return std::any_of(explained.effects.begin(), explained.effects.end(),
                       [&](const Explained::Effect& f) { return f.name == e.name; });
  };
  for (const Explained::Effect& found : explained.effects) {
    const auto truth = std::find_if(hidden.begin(), hidden.end(),
                                    [&](const EffectEntry& e) { return e.name == found.name; });
    correct += truth != hidden.end() ? 1 : 0;
    report.text += rowsOf(&found, truth == hidden.end() ? nullptr : &*truth);
  }
  for (const EffectEntry& e : hidden) {
    if (!isFound(e)) report.text += rowsOf(nullptr, &e);
  }
  report.named = correct == hidden.size() && explained.effects.size() == hidden.size();
  report.improved = explained.better;
  report.text += "\nverdict " + explained.verdict +
                 formatted("; gap %.3f -> %.3f\n", explained.gap_before, explained.gap_after);
  if (tests.empty()) report.text += "\nno further test was suggested\n";
  for (const std::string& test : tests) report.text += "\nsuggested test " + test + "\n";
  for (const std::string& rivals : explained.rivals) report.text += "\nnot distinguished: " + rivals + "\n";
  return report;
}

}  // namespace smartmill::discovery
