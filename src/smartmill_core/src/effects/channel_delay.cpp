#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// One channel is delayed.
class ChannelDelay : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"channel_delay", EffectStage::delay, 10};
    kind.title = "one channel is recorded late";
    kind.description = "one channel is delayed";
    kind.source = "filters and converters of one channel";
    kind.advice = "check the filters and the converter of this channel";
    kind.parameters = {oneOf("channel", measuredChannels()).drawnFromFirst(3),
                       number("delay_us", "us", Range::notNegative()).drawn(30.0, 200.0)};
    kind.forms = [](const Scope& s) {
      Forms forms;
      for (const std::string& channel : s.channels) {
        EffectForm form = channel == "load_meter"
                              ? EffectForm({amplitude("delay_us", {0.0, 2e5, 2.0, 10000.0})})
                                    .straight({500.0, 5000.0, 30000.0})
                              : EffectForm({amplitude("delay_us", {0.0, 5000.0, 0.02, 200.0})})
                                    .straight({10.0, 60.0, 150.0, 400.0});
        forms.push_back(form.word("channel", channel).named(channel));
      }
      return forms;
    };
    return kind;
  }

  explicit ChannelDelay(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))), delay_(1e-6 * valueOf(entry, "delay_us")) {}

  void setUp(TwinSetup& setup) const override { setup.delay[channel_] += delay_; }

 private:
  std::size_t channel_;
  double delay_;  // [s]
};

}  // namespace

EffectKind channelDelay() {
  return declared<ChannelDelay>();
}

}  // namespace smartmill::effects
