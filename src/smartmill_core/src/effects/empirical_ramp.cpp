#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Linear drift of a channel.
class ChannelRamp : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "ramp", EffectStage::signal, 60);
    kind.description =
        "a channel has an error of per_min times the time since the start of the record or the cold start of "
        "the machine";
    kind.source = "a straight line";
    kind.parameters = {oneOf("channel", streamedChannels()), oneOf("clock", clockNames()),
                       number("per_min", "N/min or V/min")};
    kind.forms = [](const Scope& s) {
      return onClocks(s, [](const std::string& channel) {
        const double unit = unitOf(channel);
        return EffectForm({amplitude("per_min", {-1e5 * unit, 1e5 * unit, 1e-2 * unit, 1e4 * unit})})
            .straight({unit});
      });
    };
    return kind;
  }

  explicit ChannelRamp(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))),
        clock_(entry),
        rate_(valueOf(entry, "per_min") / 60.0) {}

  void measure(const Instant& now, ChannelValues& c) const override { c[channel_] += rate_ * clock_(now); }

 private:
  std::size_t channel_;
  ChannelClock clock_;
  double rate_;  // [unit of the channel / s]
};

}  // namespace

EffectKind empiricalRamp() {
  return declared<ChannelRamp>();
}

}  // namespace smartmill::effects
