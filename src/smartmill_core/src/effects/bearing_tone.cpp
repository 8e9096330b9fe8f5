#include <algorithm>
#include <cmath>

#include "model/effect_declaration.h"
#include "smartmill_core/formatted.h"

namespace smartmill::effects {
namespace {

// Orders of a rolling bearing by the usual ratio of ball to pitch diameter in spindles, 0.2: cage (1 - 0.2) /
// 2, outer and inner race (1 -+ 0.2) / 2 of each ball, ball spin (1 - 0.2^2) / (2 0.2), all within a tenth.
std::string bearingPartsWith(const EffectEntry& entry) {
  const double order = entry.numbers.at("order");
  const auto isNear = [order](double other) { return std::abs(order / other - 1.0) < 0.1; };
  std::string text = formatted("bearing_tone: order %.4g is near that of", order);
  if (isNear(0.4)) text += " a bearing's cage,";
  if (isNear(2.4)) text += " a ball that spins,";
  for (const auto& [race, share] : {std::pair("an outer", 0.4), std::pair("an inner", 0.6)}) {
    const double balls = std::round(order / share);
    if (balls >= 5.0) text += formatted(" %s race with about %.0f balls,", race, balls);
  }
  const bool any = text.back() == ',';
  if (any) text.pop_back();
  return any ? text + " (exactly: the bearing's data sheet)" : "";
}

/// Force on the sensor at an order of the spindle that is not locked to its angle; its phase differs from
/// record to record. The tone is continuous, so that the force sensor responds to it in its steady state.
class BearingTone : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"bearing_tone", EffectStage::signal, 20};
    kind.title = "tone of a spindle bearing";
    kind.description =
        "sine at a multiple of the spindle speed on the sensor, x, y and z in phase, while the spindle "
        "turns; the "
        "phase is estimated from each record";
    kind.source =
        "rolling bearings: the cage slips, so that the phase is not that of the spindle; orders 0.4 (cage), "
        "0.4 and "
        "0.6 per rolling element (races)";
    kind.advice = "compare the order with the data sheets of the spindle's bearings, and watch its size";
    kind.parameters = {
        number("order", "1", Range::positive()).named("times per revolution").drawn(0.35, 12.0),
        orZero("x_n", "N").named("amplitude along x").drawn(2.0, 8.0),
        orZero("y_n", "N").named("amplitude along y").drawn(2.0, 8.0),
        orZero("z_n", "N").named("amplitude along z").drawn(2.0, 8.0)};
    kind.needs = {EffectNeed::forces};
    kind.remark = bearingPartsWith;
    kind.draw = [](const MachineModel&, EffectKind::Random& random, EffectEntry& entry) {
      // Whole orders are those of the teeth, of unbalance and of the drive.
      double& order = entry.numbers.at("order");
      std::uniform_real_distribution<double> fraction(0.02, 0.98);
      order = std::max(0.3, std::floor(order) + fraction(random));
    };
    // The sign of all sizes belongs to the phase.
    kind.forms = always(EffectForm({amplitude("order", {0.05, 60.0, 2e-4, 20.0}, 1.0),
                                    amplitude("x_n", {0.0, 2000.0, 5e-4, 20.0}),
                                    amplitude("y_n", {-2000.0, 2000.0, 5e-4, 20.0}),
                                    amplitude("z_n", {-2000.0, 2000.0, 5e-4, 20.0})})
                            .searchedBy(EffectForm::SearchStrategy::free_order)
                            .foundInEachRecord(1));
    return kind;
  }

  explicit BearingTone(const EffectEntry& entry) {
    tone_.order = valueOf(entry, "order");
    tone_.on_sensor = true;
    for (std::size_t a = 0; a < 3; ++a) tone_.amplitude[a] = valueOf(entry, (axisNames()[a] + "_n").c_str());
  }

  void measure(const Instant& now, ChannelValues& c) const override {
    const double angle = tone_.rate(now.speed) * now.record_time + tone_.phase;
    for (std::size_t a = 0; a < 3 && now.speed > 0.0; ++a) c[a] += tone_.at(a, angle);
  }
  Tone* tone() override { return &tone_; }

 private:
  Tone tone_;
};

}  // namespace

EffectKind bearingTone() {
  return declared<BearingTone>();
}

}  // namespace smartmill::effects
