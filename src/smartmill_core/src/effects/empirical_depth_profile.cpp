#include <limits>

#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Chip coefficients times a factor over a height from the tip upwards, or from the surface of the work
/// downwards.
class DepthProfile : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("law", "depth_profile", EffectStage::cutting_law, 30);
    kind.description =
        "chip coefficients times factor over this height from the tip up, or below the surface of the work";
    kind.source = "a step over the height";
    kind.parameters = {oneOf("from", {"tip", "surface"}), number("height_mm", "mm", Range::notNegative()),
                       number("factor", "1", Range::notNegative())};
    kind.needs = {EffectNeed::cuts};
    kind.forms = [](const Scope& s) {
      const double depth = s.largest_depth / units::MM;
      Forms forms;
      for (const char* from : {"tip", "surface"}) {
        EffectForm form({amplitude("factor", {0.0, 5.0, 1e-4, 0.5}, 1.0),
                         logarithm("height_mm", {std::log(0.02 * depth), std::log(0.95 * depth), 1e-3, 0.7},
                                   1.0, std::log(0.2 * depth))});
        form.scaled(0.05, {0.1 * depth, 0.2 * depth, 0.35 * depth});
        forms.push_back(form.word("from", from).named(from));
      }
      return forms;
    };
    return kind;
  }

  explicit DepthProfile(const EffectEntry& entry)
      : from_surface_(wordOf(entry, "from") == "surface"),
        height_(units::MM * valueOf(entry, "height_mm")),
        extra_(valueOf(entry, "factor") - 1.0) {}

  void setUp(TwinSetup& setup) const override {
    EdgeLayer lower;
    lower.height = height_;
    lower.from_surface = from_surface_;
    lower.share = EdgeLayer::Share::chip;
    lower.weight = from_surface_ ? -extra_ : extra_;
    setup.layers.push_back(lower);
    if (!from_surface_) return;
    // The layer below the surface is the whole edge minus the layer under it.
    EdgeLayer whole = lower;
    whole.height = std::numeric_limits<double>::infinity();
    whole.from_surface = false;
    whole.weight = extra_;
    setup.layers.push_back(whole);
  }

 private:
  bool from_surface_;
  double height_, extra_;  // [m], [1]
};

}  // namespace

EffectKind empiricalDepthProfile() {
  return declared<DepthProfile>();
}

}  // namespace smartmill::effects
