#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// A constant error of a channel from a time on.
class ChannelStep : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "step", EffectStage::signal, 50);
    kind.description =
        "a channel has an error of amplitude from this time on, since the start of the record or the cold "
        "start of the machine";
    kind.source = "a step";
    kind.parameters = {oneOf("channel", streamedChannels()), oneOf("clock", clockNames()),
                       number("at_s", "s", Range::notNegative()), number("amplitude", "N or V")};
    // Without probes: the time follows from the residual.
    kind.forms = [](const Scope& s) {
      return onClocks(s, [](const std::string& channel) {
        const double unit = unitOf(channel);
        return EffectForm({amplitude("amplitude", {-1e3 * unit, 1e3 * unit, 1e-3 * unit, 10.0 * unit})})
            .number("at_s", 0.0);
      });
    };
    return kind;
  }

  explicit ChannelStep(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))),
        clock_(entry),
        at_(valueOf(entry, "at_s")),
        amplitude_(valueOf(entry, "amplitude")) {}

  void measure(const Instant& now, ChannelValues& c) const override {
    if (clock_(now) >= at_) c[channel_] += amplitude_;
  }

 private:
  std::size_t channel_;
  ChannelClock clock_;
  double at_, amplitude_;  // [s], [unit of the channel]
};

}  // namespace

EffectKind empiricalStep() {
  return declared<ChannelStep>();
}

}  // namespace smartmill::effects
