#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Edge forces are not there at once: all of them times 1 - exp(-h / chip).
class EdgeBuildup : public Effect {
 public:
  explicit EdgeBuildup(const EffectEntry& entry) : chip_(units::UM * valueOf(entry, "chip_um")) {}

  void update(const Instant&, TwinState& state) const override { state.law.edge_chip = chip_; }

 private:
  double chip_;  // [m]
};

const EffectClass<EdgeBuildup> REGISTERED("edge_buildup");

}  // namespace
}  // namespace smartmill::sim
