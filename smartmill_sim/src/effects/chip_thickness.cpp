#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: the chip coefficients times a factor of chip thickness. Chip times factor is straight
/// between the nodes and rises with the chip.
class ChipThickness : public Effect {
 public:
  explicit ChipThickness(const EffectEntry& entry) {
    const std::vector<double>&chip = listOf(entry, "h_um"), &factor = listOf(entry, "factor");
    if (chip.size() != factor.size() || chip.size() < 2)
      throw Error("h_um and factor: two or more of each are due, as many of one as of the other");
    for (std::size_t k = 0; k < chip.size(); ++k) {
      course_.chip.push_back(units::UM * chip[k]);
      course_.effective.push_back(units::UM * chip[k] * factor[k]);
      if (k > 0 && course_.chip[k] <= course_.chip[k - 1]) throw Error("h_um does not rise");
      if (k > 0 && course_.effective[k] <= course_.effective[k - 1])
        throw Error("h_um times factor does not rise");
    }
  }

  void update(const Instant&, TwinState& state) const override { state.law.course = &course_; }

 private:
  EffectiveChipCurve course_;
};

const EffectClass<ChipThickness> REGISTERED("empirical:chip_thickness");

}  // namespace
}  // namespace smartmill::sim
