#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// A sine at a spindle order on one channel; its phase differs from record to record.
class OrderTone : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "order", EffectStage::signal, 30);
    kind.description =
        "a sine at a multiple of the spindle frequency on one channel; its phase is estimated from each "
        "record";
    kind.source = "line at a spindle order without a fixed phase";
    kind.parameters = {oneOf("channel", streamedChannels()), number("order", "1", Range::positive()),
                       number("amplitude", "N or V", Range::notNegative())};
    kind.forms = [](const Scope& s) {
      return onChannels(s, [](const std::string& channel) {
        const double unit = unitOf(channel);
        return EffectForm({amplitude("amplitude", {0.0, 1e3 * unit, 5e-4 * unit, 10.0 * unit})})
            .foundInEachRecord(1);
      });
    };
    return kind;
  }

  explicit OrderTone(const EffectEntry& entry) : channel_(channelOf(wordOf(entry, "channel"))) {
    tone_.amplitude[channel_] = valueOf(entry, "amplitude");
    tone_.order = valueOf(entry, "order");
  }

  void measure(const Instant& now, ChannelValues& c) const override {
    const double rate = tone_.rate(now.speed);
    if (rate > 0.0) c[channel_] += tone_.at(channel_, rate * now.record_time + tone_.phase);
  }
  Tone* tone() override { return &tone_; }

 private:
  std::size_t channel_;
  Tone tone_;
};

}  // namespace

EffectKind empiricalOrder() {
  return declared<OrderTone>();
}

}  // namespace smartmill::effects
