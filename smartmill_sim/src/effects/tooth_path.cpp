#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: what an earlier tooth left on a ray it left when it stood beside that ray, and with the
/// displacement that it then had (MillingProcess).
class ToothPath : public Effect {
 public:
  explicit ToothPath(const EffectEntry& entry) : share_(valueOf(entry, "share")) {}

  void setUp(TwinSetup& setup) const override { setup.path_share += share_; }

 private:
  double share_;  // [1]
};

const EffectClass<ToothPath> REGISTERED("empirical:tooth_path");

}  // namespace
}  // namespace smartmill::sim
