#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: a channel begins each record off and comes back.
class ChannelSettling : public Effect {
 public:
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

const EffectClass<ChannelSettling> REGISTERED("empirical:settling");

}  // namespace
}  // namespace smartmill::sim
