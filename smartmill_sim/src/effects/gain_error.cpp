#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// One channel's sensitivity is wrong.
class GainError : public Effect {
 public:
  explicit GainError(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))), gain_(valueOf(entry, "gain")) {}

  void measure(const Instant&, ChannelValues& c) const override { c[channel_] *= gain_; }

 private:
  std::size_t channel_;
  double gain_;  // [1] shown over true
};

const EffectClass<GainError> REGISTERED("gain_error");

}  // namespace
}  // namespace smartmill::sim
