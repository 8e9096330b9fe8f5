#include <limits>

#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: chip or edge coefficients of each tooth times a factor of its own.
class ToothFactor : public Effect {
 public:
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

const EffectClass<ToothFactor> REGISTERED("empirical:tooth_factor");

}  // namespace
}  // namespace smartmill::sim
