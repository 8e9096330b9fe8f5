#include <array>
#include <cmath>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"

namespace smartmill {

namespace {

// A mill in which every effect is possible; bounds that depend on the machine are those for this one.
MachineModel exampleMill() {
  MachineModel m;
  m.tool = ToolGeometry{4, 19.05e-3, units::radFromDeg(30.0), {}};
  m.cutting = CuttingCoefficients{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};
  Spindle s;
  s.load_meter_bandwidth = 7.0;
  m.spindle = s;
  return m;
}

std::string rangeText(const EffectParameter& p) {
  const bool any = p.choices.empty() && p.range.text() == Range().text();
  return any ? "" : "; " + p.rangeText();
}

std::string keyText(const EffectParameter& p) {
  switch (p.value) {
    case EffectValue::number:
      return p.key + " (" + p.unit + rangeText(p) + (p.optional ? "; absent: 0)" : ")");
    case EffectValue::list:
      return p.key + " (" + p.unit + ", one per tooth" + rangeText(p) +
             (p.sum ? ", sum " + shortNumber(*p.sum) + ")" : ")");
    case EffectValue::series:
    case EffectValue::table:
      return p.key + " (" + p.unit + "; any number of values" + rangeText(p) +
             (p.optional ? "; absent: none)" : ")");
    case EffectValue::modes:
      return p.key + " (modes as in tool_tip; absent: none)";
    case EffectValue::word:
      break;
  }
  std::string words;
  for (const std::string& w : p.words) words += (words.empty() ? "" : ", ") + w;
  return p.key + " (" + words + ")";
}

std::string digits(double value) {
  return formatted(std::abs(value) < 999.5 ? "%.3g" : "%.0f", std::abs(value) < 1e-12 ? 0.0 : value);
}

std::string searchText(const std::vector<EffectForm>& forms) {
  if (forms.empty()) return "";
  std::string text;
  for (const Coordinate& c : forms.front().coordinates) {
    text += (text.empty() ? "" : ", ") + c.name + " " + digits(c.low) + ".." + digits(c.high) + " (" +
            digits(c.prior_std) + ")";
  }
  std::string variants;
  for (const EffectForm& f : forms) {
    if (!f.variant.empty()) variants += (variants.empty() ? "" : " / ") + f.variant;
  }
  return text + (variants.empty() ? "" : "; as " + variants);
}

std::string needText(const EffectKind& kind) {
  static const std::array<const char*, 10> NAMES{{"cuts", "two teeth or more", "forces", "fx or fy",
                                                  "load meter", "tool with modes", "sensor modes",
                                                  "start_time_s", "cut_time_before_s", "axis motion"}};
  std::string text;
  for (const EffectNeed need : kind.needs)
    text += (text.empty() ? "" : ", ") + std::string(NAMES[static_cast<std::size_t>(need)]);
  return text;
}

std::string effectTable() {
  const MachineModel mill = exampleMill();
  EffectScope scope{mill, {"fx", "fy", "fz", "load_meter"}, {AXIS_NAMES.begin(), AXIS_NAMES.end()}};
  scope.largest_force = 500.0;
  std::string table =
      "| name | what it does | keys (unit; range) | stage | coordinates of a fit (bounds; prior deviation) "
      "| needs | "
      "source |\n|---|---|---|---|---|---|---|\n";
  for (const EffectKind& kind : effectCatalogue()) {
    std::string keys;
    for (const EffectParameter& p : kind.parameters) keys += (keys.empty() ? "" : ", ") + keyText(p);
    table += "| " + kind.name + " | " + kind.description + " | " + keys + " | " + stageName(kind.stage) +
             " | " + searchText(formsOf(kind, scope)) + " | " + needText(kind) + " | " + kind.source + " |\n";
  }
  return table;
}

}  // namespace

std::string withEffectTable(const std::string& document) {
  const std::size_t begin = document.find("<!-- effects"), end = document.find("<!-- end of effects");
  if (begin == std::string::npos || end == std::string::npos || end < begin)
    throw Error("the document lacks the lines <!-- effects and <!-- end of effects");
  const std::size_t first = document.find('\n', begin) + 1;
  return document.substr(0, first) + "\n" + effectTable() + "\n" + document.substr(end);
}

}  // namespace smartmill
