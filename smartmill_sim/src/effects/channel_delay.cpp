#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// One channel is late.
class ChannelDelay : public Effect {
 public:
  explicit ChannelDelay(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))), delay_(1e-6 * valueOf(entry, "delay_us")) {}

  void setUp(TwinSetup& setup) const override { setup.delay[channel_] += delay_; }

 private:
  std::size_t channel_;
  double delay_;  // [s]
};

const EffectClass<ChannelDelay> REGISTERED("channel_delay");

}  // namespace
}  // namespace smartmill::sim
