#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Nonlinear static characteristic of one channel.
class ChannelCurve : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "curve", EffectStage::signal, 10);
    kind.description = "a channel indicates f + odd f|f| + even f^2 + cubic f^3 instead of f, f in kN";
    kind.source = "static characteristic to third order";
    kind.parameters = {oneOf("channel", streamedChannels()), orZero("odd_per_kn", "1/kN"),
                       orZero("even_per_kn", "1/kN"), orZero("cubic_per_kn2", "1/kN2")};
    kind.needs = {EffectNeed::forces};
    kind.forms = [](const Scope& s) {
      Forms forms;
      for (EffectForm& form : onChannels(s, [](const std::string&) {
             return EffectForm({amplitude("odd_per_kn", {-3.0, 3.0, 1e-4, 0.3}),
                                amplitude("even_per_kn", {-3.0, 3.0, 1e-4, 0.3}),
                                amplitude("cubic_per_kn2", {-20.0, 20.0, 1e-4, 0.5})})
                 .straight({0.01});
           })) {
        if (form.variant != "load_meter") forms.push_back(std::move(form));
      }
      return forms;
    };
    return kind;
  }

  explicit ChannelCurve(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))),
        odd_(1e-3 * valueOf(entry, "odd_per_kn")),
        even_(1e-3 * valueOf(entry, "even_per_kn")),
        cubic_(1e-6 * valueOf(entry, "cubic_per_kn2")) {}

  void measure(const Instant&, ChannelValues& c) const override {
    double& f = c[channel_];
    f += f * (odd_ * std::abs(f) + even_ * f + cubic_ * f * f);
  }

 private:
  std::size_t channel_;
  double odd_, even_, cubic_;  // [1/N], [1/N], [1/N2]
};

}  // namespace

EffectKind empiricalCurve() {
  return declared<ChannelCurve>();
}

}  // namespace smartmill::effects
