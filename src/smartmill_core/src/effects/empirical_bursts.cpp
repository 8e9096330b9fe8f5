#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

// Without probes: period and frequency follow from the residual.
Forms burstForms(const Scope& scope) {
  return onChannels(scope, [](const std::string& channel) {
    const double unit = unitOf(channel);
    return EffectForm(
               {logarithm("period_s", {std::log(2e-3), std::log(1.0), 1e-6, 1.0}, 1.0, std::log(0.03)),
                logarithm("frequency_hz", {std::log(20.0), std::log(1e4), 1e-5, 1.0}, 1.0, std::log(1e3)),
                logarithm("decay_s", {std::log(1e-4), std::log(0.1), 1e-3, 1.0}, 1.0, std::log(2e-3)),
                amplitude("amplitude", {0.0, 1e3 * unit, 1e-3 * unit, 10.0 * unit})})
        .foundInEachRecord(1);
  });
}

/// Decaying oscillations of a channel, one every period; their start differs from record to record.
class ChannelBursts : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "bursts", EffectStage::signal, 80);
    kind.description =
        "every period a channel oscillates with amplitude exp(-t / decay) sin(2 pi frequency t); the start "
        "is estimated from each record";
    kind.source = "periodic decaying oscillation";
    kind.parameters = {oneOf("channel", streamedChannels()), number("period_s", "s", Range::positive()),
                       number("frequency_hz", "Hz", Range::positive()),
                       number("decay_s", "s", Range::positive()),
                       number("amplitude", "N or V", Range::notNegative())};
    kind.forms = burstForms;
    return kind;
  }

  explicit ChannelBursts(const EffectEntry& entry) {
    train_.channel = channelOf(wordOf(entry, "channel"));
    train_.period = valueOf(entry, "period_s");
    train_.frequency = valueOf(entry, "frequency_hz");
    train_.decay = valueOf(entry, "decay_s");
    train_.amplitude = valueOf(entry, "amplitude");
  }

  void measure(const Instant& now, ChannelValues& c) const override {
    if (train_.amplitude != 0.0) c[train_.channel] += train_.at(now.record_time);
  }
  BurstTrain* bursts() override { return &train_; }

 private:
  BurstTrain train_;
};

}  // namespace

EffectKind empiricalBursts() {
  return declared<ChannelBursts>();
}

}  // namespace smartmill::effects
