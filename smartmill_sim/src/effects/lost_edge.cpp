#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: below a height one tooth does not cut, and the next one takes its chip.
class LostEdge : public Effect {
 public:
  explicit LostEdge(const EffectEntry& entry)
      : tooth_(static_cast<int>(valueOf(entry, "tooth")) - 1),
        height_(units::MM * valueOf(entry, "height_mm")) {}

  void setUp(TwinSetup& setup) const override {
    if (!setup.model.tool || height_ == 0.0) return;
    if (tooth_ >= setup.model.tool->teeth) throw Error("the tool has no tooth " + std::to_string(tooth_ + 1));
    EdgeLayer without_tooth;
    without_tooth.height = height_;
    without_tooth.missing_tooth = tooth_;
    EdgeLayer instead = without_tooth;
    instead.missing_tooth = -1;
    instead.weight = -1.0;
    setup.layers.push_back(without_tooth);
    setup.layers.push_back(instead);
  }

 private:
  int tooth_;      // from 0
  double height_;  // [m]
};

const EffectClass<LostEdge> REGISTERED("empirical:lost_edge");

}  // namespace
}  // namespace smartmill::sim
