#include <limits>

#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

// Logarithms of the factors of `count` teeth from the first on; the other factors are 1.
EffectCoordinates factors(std::size_t teeth, std::size_t first, std::size_t count) {
  const FitRange range = factorRange();
  constexpr double LEAST = -5.0;  // a tooth that hardly cuts
  EffectCoordinates c;
  for (std::size_t k = 0; k < count; ++k)
    c.coordinates.push_back({"ln factor of tooth " + std::to_string(first + k + 1), 0.0, LEAST, range.high,
                             range.step, range.prior_std});
  c.write = [=](const double* v, EffectEntry& e) {
    Values& list = e.lists["factor"];
    list.assign(teeth, 1.0);
    for (std::size_t k = 0; k < count; ++k) list[first + k] = std::exp(v[k]);
  };
  c.read = [=](const EffectEntry& e, double* v) {
    for (std::size_t k = 0; k < count; ++k) v[k] = std::log(e.lists.at("factor").at(first + k));
  };
  return c;
}

// One tooth that differs from the others; then any table relative to the first tooth.
Forms tableForms(const Scope& scope) {
  const auto teeth = static_cast<std::size_t>(scope.nominal.tool->teeth);
  Forms forms;
  for (const char* of : {"chip", "edge"}) {
    const auto add = [&](std::size_t first, std::size_t count, const std::string& name) {
      EffectForm form({factors(teeth, first, count)});
      forms.push_back(form.straight({0.02}).word("of", of).named(std::string(of) + ", " + name));
    };
    for (std::size_t k = 0; k < teeth; ++k) add(k, 1, "tooth " + std::to_string(k + 1));
    if (teeth > 2) add(1, teeth - 1, "all teeth");
  }
  return forms;
}

/// Chip or edge coefficients of each tooth times a factor of its own.
class ToothFactor : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("law", "tooth_factor", EffectStage::cutting_law, 40);
    kind.description = "chip or edge coefficients of each tooth times its factor";
    kind.source = "a table over the teeth";
    kind.parameters = {oneOf("of", {"chip", "edge"}), perTooth("factor", "1", Range::notNegative())};
    kind.needs = {EffectNeed::cuts, EffectNeed::several_teeth};
    kind.forms = tableForms;
    return kind;
  }

  explicit ToothFactor(const EffectEntry& entry)
      : chip_(wordOf(entry, "of") == "chip"), factor_(listOf(entry, "factor")) {}

  void setUp(TwinSetup& setup) const override {
    if (!setup.model.tool) return;
    checkTeeth("factor", factor_.size(), *setup.model.tool);
    for (std::size_t k = 0; k < factor_.size(); ++k) {
      EdgeLayer layer;
      layer.weight = factor_[k] - 1.0;
      layer.height = std::numeric_limits<double>::infinity();
      layer.share = chip_ ? EdgeLayer::Share::chip : EdgeLayer::Share::edge;
      layer.only_tooth = static_cast<int>(k);
      if (layer.weight != 0.0) setup.layers.push_back(layer);
    }
  }

 private:
  bool chip_;
  std::vector<double> factor_;  // [1] of each tooth
};

}  // namespace

EffectKind empiricalToothFactor() {
  return declared<ToothFactor>();
}

}  // namespace smartmill::effects
