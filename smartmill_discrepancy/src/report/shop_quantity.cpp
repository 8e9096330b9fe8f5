#include "smartmill_discrepancy/report/shop_quantity.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

using Quantities = std::vector<ShopQuantity>;
using Parameters = std::vector<FoundParameter>;

const FoundParameter& find(const Parameters& parameters, const std::string& key) {
  static const FoundParameter ABSENT;
  const auto found = std::find_if(parameters.begin(), parameters.end(),
                                  [&](const FoundParameter& p) { return p.key == key; });
  return found == parameters.end() ? ABSENT : *found;
}

Quantities ofRunout(const Parameters& p, const ShopConditions&) {
  const FoundParameter& offset = find(p, "offset_um");
  const double factor = 2.0 * units::UM / units::MM;
  return {
      {"a dial indicator on the turning shank reads", factor * offset.value, factor * offset.std_dev, "mm"}};
}

Quantities ofUnbalance(const Parameters& p, const ShopConditions& conditions) {
  const FoundParameter& mass = find(p, "mass_eccentricity_g_mm");
  const double force = 1e-6 * conditions.highest_speed * conditions.highest_speed;  // [N] of 1 g mm
  return {
      {formatted("rotating force at %.0f rpm, the highest speed of the tests (it grows with the square of "
                 "the speed)",
                 units::rpmFromRadPerSec(conditions.highest_speed)),
       force * mass.value, force * mass.std_dev, "N"}};
}

Quantities ofWear(const Parameters& p, const ShopConditions& conditions) {
  const FoundParameter& growth = find(p, "edge_growth_per_min");
  const double minutes = conditions.cutting_time / 60.0;
  Quantities all;
  if (minutes > 0.0)
    all.push_back({formatted("edge force after the last cut (%.1f min of cutting)", minutes),
                   1.0 + growth.value * minutes, growth.std_dev * minutes, "times that of a sharp edge"});
  if (growth.value > 0.0)
    all.push_back({"cutting time in which the edge force of a sharp edge doubles", 1.0 / growth.value,
                   growth.std_dev / (growth.value * growth.value), "min"});
  return all;
}

// Percent by which a factor differs from one.
Quantities ofFactor(const char* name, const FoundParameter& factor) {
  return {{name, 100.0 * (factor.value - 1.0), 100.0 * factor.std_dev, "%"}};
}

// Power law with this exponent at half the reference.
Quantities ofPower(const char* name, const FoundParameter& exponent) {
  const double factor = std::exp2(exponent.value);
  return {{name, 100.0 * (factor - 1.0), 100.0 * factor * std::log(2.0) * exponent.std_dev, "%"}};
}

Quantities ofMass(const Parameters& p, const ShopConditions&) {
  const FoundParameter& ratio = find(p, "mass_ratio");
  const double factor = 1.0 / std::sqrt(1.0 + ratio.value);
  return {{"fall of the first resonance of the force sensor", 100.0 * (1.0 - factor),
           50.0 * std::pow(factor, 3) * ratio.std_dev, "%"}};
}

Quantities ofRadii(const Parameters& p, const ShopConditions&) {
  if (p.empty()) return {};
  const auto [low, high] = std::minmax_element(
      p.begin(), p.end(), [](const FoundParameter& a, const FoundParameter& b) { return a.value < b.value; });
  return {{"largest difference of the radius between two teeth", high->value - low->value,
           std::hypot(high->std_dev, low->std_dev), "um"}};
}

Quantities derived(const std::string& effect, const Parameters& parameters,
                   const ShopConditions& conditions) {
  static const std::map<std::string, std::function<Quantities(const Parameters&, const ShopConditions&)>>
      DERIVED{
          {"runout", ofRunout},
          {"unbalance", ofUnbalance},
          {"tool_wear", ofWear},
          {"mass_loading", ofMass},
          {"tooth_radius", ofRadii},
          {"feed_error",
           [](const Parameters& p, const ShopConditions&) {
             return ofFactor("actual minus commanded feed", find(p, "ratio"));
           }},
          {"gain_error",
           [](const Parameters& p, const ShopConditions&) {
             return ofFactor("the channel indicates too much by", find(p, "gain"));
           }},
          {"size_effect",
           [](const Parameters& p, const ShopConditions&) {
             return ofPower("additional force per chip area at half the chip thickness", find(p, "exponent"));
           }},
          {"cutting_speed", [](const Parameters& p, const ShopConditions&) {
             return ofPower("additional force per chip area at half the cutting speed", find(p, "exponent"));
           }}};
  const auto found = DERIVED.find(effect);
  return found == DERIVED.end() ? Quantities() : found->second(parameters, conditions);
}

// A key, or an item of a list or of modes, in words.
ShopQuantity inWords(const EffectKind& kind, const FoundParameter& p) {
  static const std::map<std::string, std::pair<const char*, const char*>> OF_MODES{
      {"frequency_hz", {"frequency", "Hz"}},
      {"damping_ratio", {"damping ratio", "1"}},
      {"stiffness_n_per_um", {"stiffness", "N/um"}}};
  const EffectParameter& parameter = parameterOf(kind, p.key);
  ShopQuantity q{parameter.quantity(), p.known(), p.std_dev, parameter.unit, p.modulo};
  const std::size_t bracket = p.key.find('['), point = p.key.find("].");
  if (point != std::string::npos) {
    const auto& [name, unit] = OF_MODES.at(p.key.substr(point + 2));
    q.name = "resonance along " + p.key.substr(0, bracket) + ": " + name;
    q.unit = unit;
  } else if (bracket != std::string::npos) {
    const int item = std::stoi(p.key.substr(bracket + 1)) + 1;
    q.name = formatted(parameter.value == EffectValue::list ? "tooth %d: " : "%d: ", item) + q.name;
  }
  return q;
}

}  // namespace

ShopConditions conditionsOf(const std::vector<ReportedTest>& tests) {
  ShopConditions conditions;
  for (const ReportedTest& t : tests) {
    conditions.highest_speed = std::max(conditions.highest_speed, t.test.spindle_speed);
    if (t.test.kind == TestKind::cut && t.test.cut_time_before)
      conditions.cutting_time = std::max(
          conditions.cutting_time, *t.test.cut_time_before + t.duration - t.test.engage_time.value_or(0.0));
  }
  return conditions;
}

std::vector<ShopQuantity> shopQuantities(const std::string& effect,
                                         const std::vector<FoundParameter>& parameters,
                                         const ShopConditions& conditions) {
  Quantities all = derived(effect, parameters, conditions);
  for (const FoundParameter& p : parameters) all.push_back(inWords(*findEffect(effect), p));
  return all;
}

}  // namespace smartmill::discrepancy
