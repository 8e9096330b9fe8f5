#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Surface by the true path of the teeth: a ray is cut by an earlier tooth when that tooth lies on the ray,
/// with its displacement at that time.
class ToothPath : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("geometry", "tooth_path", EffectStage::geometry, 10);
    kind.description =
        "an earlier tooth leaves the surface on a ray when it lies on that ray, with its displacement at "
        "that time; share of the way from the rule of the surface to this one";
    kind.source = "the surface of trochoidal paths";
    kind.parameters = {number("share", "1")};
    kind.needs = {EffectNeed::cuts};
    kind.forms = [](const Scope&) { return Forms{}; };  // a nominal value of every fit
    return kind;
  }

  explicit ToothPath(const EffectEntry& entry) : share_(valueOf(entry, "share")) {}

  void setUp(TwinSetup& setup) const override { setup.path_share += share_; }

 private:
  double share_;  // [1]
};

}  // namespace

EffectKind empiricalToothPath() {
  return declared<ToothPath>();
}

}  // namespace smartmill::effects
