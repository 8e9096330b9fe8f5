#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// The flank meets the wavy surface: radial force C v_r / v_c per length of engaged edge, v_r the velocity
/// into the work; 0.3 of it tangential.
class ProcessDamping : public Effect {
 public:
  explicit ProcessDamping(const EffectEntry& entry)
      : coefficient_(units::N_PER_MM * valueOf(entry, "coefficient_n_per_mm")) {}

  void update(const Instant&, TwinState& state) const override { state.law.damping += coefficient_; }

 private:
  double coefficient_;  // [N/m]
};

const EffectClass<ProcessDamping> REGISTERED("process_damping");

}  // namespace
}  // namespace smartmill::sim
