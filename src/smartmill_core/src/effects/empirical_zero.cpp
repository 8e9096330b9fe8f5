#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// The zero of a force channel, which differs from record to record.
class ChannelZero : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "zero", EffectStage::signal, 90);
    kind.description =
        "share times the zero of a force channel in each record, which is estimated from the record where "
        "nothing cuts";
    kind.source = "charge amplifiers: zero after each reset, drift between records";
    kind.parameters = {oneOf("channel", forceNames()), number("share", "1")};
    kind.needs = {EffectNeed::forces};
    kind.forms = [](const Scope& scope) {
      Forms forms;
      for (const std::string& channel : forceNames()) {
        if (!scope.channels.count(channel)) continue;
        EffectForm form({amplitude("share", {-2.0, 2.0, 1e-3, 1.0})});
        form.straight({1.0}).foundInEachRecord(1);
        forms.push_back(form.word("channel", channel).named(channel));
      }
      return forms;
    };
    return kind;
  }

  explicit ChannelZero(const EffectEntry& entry) {
    zero_.channel = channelOf(wordOf(entry, "channel"));
    zero_.share = valueOf(entry, "share");
  }

  void measure(const Instant&, ChannelValues& c) const override {
    c[zero_.channel] += zero_.share * zero_.value;
  }
  RecordZero* zero() override { return &zero_; }

 private:
  RecordZero zero_;
};

}  // namespace

EffectKind empiricalZero() {
  return declared<ChannelZero>();
}

}  // namespace smartmill::effects
