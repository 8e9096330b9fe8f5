#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: a line on one channel whose phase is another one each record.
class ChannelTone : public Effect {
 public:
  explicit ChannelTone(const EffectEntry& entry) : channel_(channelOf(wordOf(entry, "channel"))) {
    tone_.amplitude[channel_] = valueOf(entry, "amplitude");
  }

  void measure(const Instant& now, ChannelValues& c) const override {
    const double rate = tone_.rate(now.speed);
    if (rate > 0.0 && (always_ || now.speed > 0.0))
      c[channel_] += tone_.amplitude[channel_] * std::sin(rate * now.record_time + tone_.phase);
  }
  Tone* tone() override { return &tone_; }

 protected:
  Tone tone_;
  bool always_ = true;  // not only while the spindle turns

 private:
  std::size_t channel_;
};

class FrequencyTone : public ChannelTone {
 public:
  explicit FrequencyTone(const EffectEntry& entry) : ChannelTone(entry) {
    tone_.frequency = valueOf(entry, "frequency_hz");
    always_ = wordOf(entry, "while") == "always";
  }
};

class OrderTone : public ChannelTone {
 public:
  explicit OrderTone(const EffectEntry& entry) : ChannelTone(entry) { tone_.order = valueOf(entry, "order"); }
};

const EffectClass<FrequencyTone> FREQUENCY("empirical:tone");
const EffectClass<OrderTone> ORDER("empirical:order");

}  // namespace
}  // namespace smartmill::sim
