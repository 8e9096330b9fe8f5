#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Mains hum, in phase on fx and fy; its phase differs from record to record.
class MainsHum : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"mains_hum", EffectStage::signal, 30};
    kind.title = "mains hum in the force signals";
    kind.description = "sine on fx, y_ratio of it in phase on fy; the phase is estimated from each record";
    kind.source = "coupling of the mains into the charge lines";
    kind.advice = "check grounding and shield of the sensor cables";
    kind.parameters = {
        oneOfNumbers("frequency_hz", "Hz", {50.0, 60.0}).named("frequency"),
        number("amplitude_n", "N").named("amplitude in fx").drawn(2.0, 12.0),
        number("y_ratio", "1").named("amplitude in fy over that in fx").drawnOnBothSides(0.3, 1.2)};
    kind.needs = {EffectNeed::plane_forces};
    kind.forms = [](const Scope&) {
      Forms forms;
      for (const double frequency : {50.0, 60.0}) {
        // The phase is undefined at zero amplitude: the points lie away from it.
        forms.push_back(EffectForm({amplitude("amplitude_n", {0.0, 1e4, 0.0005, 10.0}),
                                    amplitude("y_ratio", {-20.0, 20.0, 0.000125, 1.0}, 0.5)})
                            .probe({0.0, 0.6}, {{2.0, 0.6}})
                            .probe({0.0, -0.6}, {{2.0, -0.6}})
                            .number("frequency_hz", frequency)
                            .foundInEachRecord(1)
                            .named(frequency == 50.0 ? "50 Hz" : "60 Hz"));
      }
      return forms;
    };
    return kind;
  }

  explicit MainsHum(const EffectEntry& entry) {
    tone_.frequency = valueOf(entry, "frequency_hz");
    tone_.amplitude[FX] = valueOf(entry, "amplitude_n");
    tone_.amplitude[FY] = valueOf(entry, "y_ratio") * tone_.amplitude[FX];
  }

  void measure(const Instant& now, ChannelValues& c) const override {
    const double angle = tone_.rate(now.speed) * now.record_time + tone_.phase;
    for (const std::size_t channel : {FX, FY}) c[channel] += tone_.at(channel, angle);
  }
  Tone* tone() override { return &tone_; }

 private:
  Tone tone_;
};

}  // namespace

EffectKind mainsHum() {
  return declared<MainsHum>();
}

}  // namespace smartmill::effects
