#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: the static characteristic of one channel is bent.
class ChannelCurve : public Effect {
 public:
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

const EffectClass<ChannelCurve> REGISTERED("empirical:curve");

}  // namespace
}  // namespace smartmill::sim
