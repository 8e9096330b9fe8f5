#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// An error of a channel at the start of each record that decays.
class ChannelSettling : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "settling", EffectStage::signal, 40);
    kind.description =
        "a channel starts each record with an error of amplitude, which decays with exp(-t / constant)";
    kind.source = "exponential approach";
    kind.parameters = {oneOf("channel", streamedChannels()), number("amplitude", "N or V"),
                       number("time_constant_s", "s", Range::positive())};
    kind.forms = [](const Scope& s) {
      return onChannels(s, [](const std::string& channel) {
        const double unit = unitOf(channel);
        return EffectForm({amplitude("amplitude", {-1e3 * unit, 1e3 * unit, 1e-3 * unit, 10.0 * unit}),
                           logarithm("time_constant_s", {std::log(2e-3), std::log(2.0), 1e-3, 0.7}, 1.0,
                                     std::log(0.05))})
            .scaled(unit, {0.01, 0.03, 0.06, 0.15});
      });
    };
    return kind;
  }

  explicit ChannelSettling(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))),
        amplitude_(valueOf(entry, "amplitude")),
        constant_(valueOf(entry, "time_constant_s")) {}

  void measure(const Instant& now, ChannelValues& c) const override {
    c[channel_] += amplitude_ * std::exp(-now.record_time / constant_);
  }

 private:
  std::size_t channel_;
  double amplitude_, constant_;  // [unit of the channel], [s]
};

}  // namespace

EffectKind empiricalSettling() {
  return declared<ChannelSettling>();
}

}  // namespace smartmill::effects
