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

const EffectClass<ChannelTransfer> REGISTERED("empirical:transfer");

}  // namespace
}  // namespace smartmill::sim
