#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: a channel passes slow and quick changes with gains of their own.
class ChannelTransfer : public Effect {
 public:
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

/// Without a name: a mode on the way from one force channel to another, or within one.
class ChannelResonance : public Effect {
 public:
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

const EffectClass<ChannelTransfer> TRANSFER("empirical:transfer");
const EffectClass<ChannelResonance> RESONANCE("empirical:resonance");

}  // namespace
}  // namespace smartmill::sim
