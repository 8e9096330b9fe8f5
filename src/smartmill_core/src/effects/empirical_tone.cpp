#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

// Without probes: the frequency follows from the residual.
Forms lineForms(const Scope& scope) {
  Forms forms;
  for (const bool always_on : {true, false}) {
    for (EffectForm& form : onChannels(scope, [](const std::string& channel) {
           const double unit = unitOf(channel);
           return EffectForm({amplitude("frequency_hz", {1.0, 6000.0, 2e-3, 1000.0}, 100.0),
                              amplitude("amplitude", {0.0, 1e3 * unit, 5e-4 * unit, 10.0 * unit})});
         })) {
      if (!always_on) form.named(form.variant + ", turning");
      forms.push_back(form.word("while", always_on ? "always" : "turning").foundInEachRecord(1));
    }
  }
  return forms;
}

/// A sine at a fixed frequency on one channel; its phase differs from record to record.
class FrequencyTone : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "tone", EffectStage::signal, 20);
    kind.description =
        "a sine at a fixed frequency on one channel, always or while the spindle turns; its phase is "
        "estimated from each record";
    kind.source = "line that is not locked to the spindle";
    kind.parameters = {oneOf("channel", streamedChannels()), oneOf("while", {"always", "turning"}),
                       number("frequency_hz", "Hz", Range::positive()),
                       number("amplitude", "N or V", Range::notNegative())};
    kind.forms = lineForms;
    return kind;
  }

  explicit FrequencyTone(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))), always_(wordOf(entry, "while") == "always") {
    tone_.amplitude[channel_] = valueOf(entry, "amplitude");
    tone_.frequency = valueOf(entry, "frequency_hz");
  }

  void measure(const Instant& now, ChannelValues& c) const override {
    const double rate = tone_.rate(now.speed);
    if (rate > 0.0 && (always_ || now.speed > 0.0))
      c[channel_] += tone_.at(channel_, rate * now.record_time + tone_.phase);
  }
  Tone* tone() override { return &tone_; }

 private:
  std::size_t channel_;
  bool always_;  // not only while the spindle turns
  Tone tone_;
};

}  // namespace

EffectKind empiricalTone() {
  return declared<FrequencyTone>();
}

}  // namespace smartmill::effects
