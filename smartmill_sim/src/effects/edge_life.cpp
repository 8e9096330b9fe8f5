#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: chip or edge coefficients change over the life of the edge, and come to rest.
class EdgeLife : public Effect {
 public:
  explicit EdgeLife(const EffectEntry& entry)
      : chip_(wordOf(entry, "of") == "chip"),
        amplitude_(valueOf(entry, "amplitude")),
        constant_(valueOf(entry, "time_constant_s")) {}

  void update(const Instant& now, TwinState& state) const override {
    (chip_ ? state.law.chip_factor : state.law.edge_factor) *=
        1.0 - amplitude_ * std::expm1(-now.edge_time / constant_);
  }
  bool scalesForce() const override { return true; }

 private:
  bool chip_;
  double amplitude_, constant_;  // [1], [s]
};

const EffectClass<EdgeLife> REGISTERED("empirical:edge_life");

}  // namespace
}  // namespace smartmill::sim
