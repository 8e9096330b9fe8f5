#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Adds to the chip coefficients, as edge_forces does to those of the edge.
class ChipCoefficients : public Effect {
 public:
  explicit ChipCoefficients(const EffectEntry& entry)
      : ktc_(units::N_PER_MM2 * valueOf(entry, "Ktc_n_per_mm2")),
        krc_(units::N_PER_MM2 * valueOf(entry, "Krc_n_per_mm2")),
        kac_(units::N_PER_MM2 * valueOf(entry, "Kac_n_per_mm2")) {}

  void update(const Instant&, TwinState& state) const override {
    state.law.coefficients.ktc += ktc_;
    state.law.coefficients.krc += krc_;
    state.law.coefficients.kac += kac_;
  }
  bool scalesForce() const override { return true; }

 private:
  double ktc_, krc_, kac_;  // [N/m2]
};

const EffectClass<ChipCoefficients> REGISTERED("chip_coefficients");

}  // namespace
}  // namespace smartmill::sim
