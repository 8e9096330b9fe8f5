#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

// Without probes: the frequency follows from the residual.
Forms pathForms(const Scope& scope) {
  Forms forms;
  for (const std::string& to : forceNames()) {
    for (const std::string& from : forceNames()) {
      if (!scope.channels.count(to) || !scope.channels.count(from)) continue;
      EffectForm form(
          {logarithm("frequency_hz", {std::log(20.0), std::log(1e4), 1e-5, 1.0}, 1.0, std::log(800.0)),
           logarithm("damping_ratio", {std::log(1e-3), std::log(0.5), 1e-3, 1.0}, 1.0, std::log(0.04)),
           amplitude("gain", {-3.0, 3.0, 1e-5, 0.5})});
      form.word("channel", to).word("from", from);
      forms.push_back(form.named(to + " from " + from));
    }
  }
  return forms;
}

/// A mode in the path from one force channel to another, or within one.
class ChannelResonance : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "resonance", EffectStage::sensor_output, 10);
    kind.description =
        "gain times the response of a mode to another force channel is added to a channel; from the channel "
        "itself, gain times the change by the mode";
    kind.source = "one mode of a transfer matrix";
    kind.parameters = {oneOf("channel", forceNames()), oneOf("from", forceNames()),
                       number("frequency_hz", "Hz", Range::positive()),
                       number("damping_ratio", "1", Range::open(0.0, 1.0)), number("gain", "1")};
    kind.needs = {EffectNeed::forces};
    kind.forms = pathForms;
    return kind;
  }

  explicit ChannelResonance(const EffectEntry& entry) {
    resonance_.channel = channelOf(wordOf(entry, "channel"));
    resonance_.from = channelOf(wordOf(entry, "from"));
    resonance_.mode.frequency = valueOf(entry, "frequency_hz");
    resonance_.mode.damping_ratio = valueOf(entry, "damping_ratio");
    resonance_.mode.gain = valueOf(entry, "gain");
  }

  void setUp(TwinSetup& setup) const override {
    if (resonance_.mode.gain != 0.0) setup.resonances.push_back(resonance_);
  }

 private:
  Resonance resonance_;
};

}  // namespace

EffectKind empiricalResonance() {
  return declared<ChannelResonance>();
}

}  // namespace smartmill::effects
