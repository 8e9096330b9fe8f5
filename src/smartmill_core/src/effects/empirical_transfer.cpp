#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

// One of the two gains is 1.
Forms shelfForms(const Scope& scope) {
  Forms forms;
  for (const bool above : {true, false}) {
    for (EffectForm& form : onChannels(scope, [&](const std::string&) {
           const Values corners = above ? Values{50.0, 200.0, 800.0, 2500.0} : Values{0.3, 2.0, 10.0, 50.0};
           return EffectForm({amplitude(above ? "above" : "below", {-0.5, 3.0, 1e-4, 0.3}, 1.0),
                              logarithm("corner_hz", {std::log(0.05), std::log(1e4), 1e-3, 1.0}, 1.0,
                                        std::log(corners[1]))})
               .scaled(0.02, corners)
               .number(above ? "below" : "above", 1.0);
         })) {
      if (form.variant != "load_meter")
        forms.push_back(form.named(form.variant + (above ? ", above" : ", below")));
    }
  }
  return forms;
}

/// Different gains of a channel below and above a corner frequency.
class ChannelTransfer : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "transfer", EffectStage::sensor_output, 20);
    kind.description =
        "a channel indicates above x + (below - above) L(x), L a first-order low pass with this corner";
    kind.source = "first-order shelf; below 0: high pass, above 0: low pass";
    kind.parameters = {oneOf("channel", streamedChannels()), number("corner_hz", "Hz", Range::positive()),
                       number("below", "1"), number("above", "1")};
    kind.needs = {EffectNeed::forces};
    kind.forms = shelfForms;
    return kind;
  }

  explicit ChannelTransfer(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))),
        shelf_{valueOf(entry, "corner_hz"), valueOf(entry, "below"), valueOf(entry, "above")} {}

  void setUp(TwinSetup& setup) const override {
    if (shelf_.below != 1.0 || shelf_.above != 1.0) setup.shelves.emplace_back(channel_, shelf_);
  }

 private:
  std::size_t channel_;
  Shelf shelf_;
};

}  // namespace

EffectKind empiricalTransfer() {
  return declared<ChannelTransfer>();
}

}  // namespace smartmill::effects
