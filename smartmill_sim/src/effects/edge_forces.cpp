#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Adds to the edge coefficients.
class EdgeForces : public Effect {
 public:
  explicit EdgeForces(const EffectEntry& entry)
      : kte_(units::N_PER_MM * valueOf(entry, "Kte_n_per_mm")),
        kre_(units::N_PER_MM * valueOf(entry, "Kre_n_per_mm")),
        kae_(units::N_PER_MM * valueOf(entry, "Kae_n_per_mm")) {}

  void update(const Instant&, TwinState& state) const override {
    state.law.coefficients.kte += kte_;
    state.law.coefficients.kre += kre_;
    state.law.coefficients.kae += kae_;
  }
  bool scalesForce() const override { return true; }

 private:
  double kte_, kre_, kae_;  // [N/m]
};

const EffectClass<EdgeForces> REGISTERED("edge_forces");

}  // namespace
}  // namespace smartmill::sim
