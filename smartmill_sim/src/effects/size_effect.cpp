#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Kc times (h / reference)^(-exponent): thin chips cut harder; edge terms stay.
class SizeEffect : public Effect {
 public:
  explicit SizeEffect(const EffectEntry& entry)
      : exponent_(valueOf(entry, "exponent")), reference_(units::UM * valueOf(entry, "reference_chip_um")) {}

  void update(const Instant&, TwinState& state) const override {
    state.law.size_exponent = exponent_;
    state.law.size_reference = reference_;
  }

 private:
  double exponent_, reference_;  // [1], [m]
};

const EffectClass<SizeEffect> REGISTERED("size_effect");

}  // namespace
}  // namespace smartmill::sim
