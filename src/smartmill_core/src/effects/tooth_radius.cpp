#include <numeric>

#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

void drawOneShortTooth(const MachineModel& machine, EffectKind::Random& random, EffectEntry& entry) {
  const auto teeth = static_cast<std::size_t>(machine.tool->teeth);
  std::vector<double>& offset = entry.lists["offset_um"];
  for (std::size_t k = 0; k < teeth; ++k) offset.push_back(between(random, -3.0, 3.0));
  offset[std::uniform_int_distribution<std::size_t>(0, teeth - 1)(random)] -= between(random, 8.0, 30.0);
  const double mean = std::accumulate(offset.begin(), offset.end(), 0.0) / static_cast<double>(teeth);
  for (double& o : offset) o -= mean;
}

/// A radius of its own for each tooth: chipped, re-ground or badly seated inserts. Only differences act.
class ToothRadius : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"tooth_radius", EffectStage::geometry, 30};
    kind.title = "teeth of unequal radius";
    kind.description =
        "tooth j cuts at radius R + offset[j]: a chipped, re-ground or badly seated insert; only differences "
        "act";
    kind.source = "Kline & DeVor 1983, with a radius for each tooth";
    kind.advice =
        "measure the radius of each tooth in the presetter or with the laser; replace or reseat the insert "
        "that differs";
    kind.parameters = {perTooth("offset_um", "um").named("deviation of the radius")};
    kind.needs = {EffectNeed::cuts, EffectNeed::several_teeth};
    kind.forms = [](const Scope& s) {
      return Forms{EffectForm({contrasts("offset_um", s.nominal.tool->teeth, {-200.0, 200.0, 5e-4, 20.0})})
                       .straight({1.0, 15.0})};
    };
    kind.draw = drawOneShortTooth;
    kind.bic_penalty = 20.0;  // up to three teeth no record distinguishes it from runout
    return kind;
  }

  explicit ToothRadius(const EffectEntry& entry) : offset_(listOf(entry, "offset_um")) {
    const double mean =
        std::accumulate(offset_.begin(), offset_.end(), 0.0) / static_cast<double>(offset_.size());
    for (double& o : offset_) o = units::UM * (o - mean);
  }

  void setUp(TwinSetup& setup) const override {
    if (!setup.model.tool) return;
    checkTeeth("tooth_radius", offset_.size(), *setup.model.tool);
    for (std::size_t j = 0; j < offset_.size(); ++j) setup.radius_offset[j] += offset_[j];
  }

 private:
  std::vector<double> offset_;  // [m] mean 0
};

}  // namespace

EffectKind toothRadius() {
  return declared<ToothRadius>();
}

}  // namespace smartmill::effects
