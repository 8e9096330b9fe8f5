#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// An error of a channel that grows to a final value as the machine warms up.
class ChannelApproach : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "approach", EffectStage::signal, 70);
    kind.description =
        "a channel has an error of amplitude x (1 - exp(-t / constant)), t since the cold start of the "
        "machine";
    kind.source = "exponential approach";
    kind.parameters = {oneOf("channel", streamedChannels()), number("amplitude", "N or V"),
                       number("time_constant_s", "s", Range::positive())};
    kind.needs = {EffectNeed::start_time};
    kind.forms = [](const Scope& s) {
      return onChannels(s, [&](const std::string& channel) {
        const double unit = unitOf(channel);
        return exponentialApproach({-1e3 * unit, 1e3 * unit, 1e-3 * unit, 10.0 * unit}, unit, s.first_cut);
      });
    };
    return kind;
  }

  explicit ChannelApproach(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))),
        amplitude_(valueOf(entry, "amplitude")),
        constant_(valueOf(entry, "time_constant_s")) {}

  void measure(const Instant& now, ChannelValues& c) const override {
    c[channel_] -= amplitude_ * std::expm1(-(now.start_time + now.record_time) / constant_);
  }

 private:
  std::size_t channel_;
  double amplitude_, constant_;  // [unit of the channel], [s]
};

}  // namespace

EffectKind empiricalApproach() {
  return declared<ChannelApproach>();
}

}  // namespace smartmill::effects
