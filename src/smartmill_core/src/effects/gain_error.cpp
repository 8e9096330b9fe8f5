#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// A wrong sensitivity of one channel.
class GainError : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"gain_error", EffectStage::sensor_output, 20};
    kind.title = "wrong sensitivity of one channel";
    kind.description = "one channel's sensitivity is wrong: it indicates gain times the value";
    kind.source = "calibration of one channel";
    kind.advice = "check the stated sensitivity of this channel with a known weight";
    kind.parameters = {
        oneOf("channel", measuredChannels()).drawnFromFirst(4),
        number("gain", "1").named("indicated over true value").drawnOnBothSides(0.06, 0.2, 1.0)};
    kind.forms = [](const Scope& s) {
      Forms forms;
      for (const std::string& channel : s.channels) {
        forms.push_back(EffectForm({logarithm("gain", {std::log(0.05), std::log(5.0), 1e-4, 0.2})})
                            .straight({0.02})
                            .word("channel", channel)
                            .named(channel));
      }
      return forms;
    };
    // Beyond the stated uncertainty of the load meter's constant.
    kind.draw = [](const MachineModel&, EffectKind::Random& random, EffectEntry& entry) {
      if (entry.words["channel"] == "load_meter") entry.numbers["gain"] = 1.0 + eitherSign(random, 0.15, 0.3);
    };
    return kind;
  }

  explicit GainError(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))), gain_(valueOf(entry, "gain")) {}

  void measure(const Instant&, ChannelValues& c) const override { c[channel_] *= gain_; }

 private:
  std::size_t channel_;
  double gain_;  // [1] indicated over true
};

}  // namespace

EffectKind gainError() {
  return declared<GainError>();
}

}  // namespace smartmill::effects
