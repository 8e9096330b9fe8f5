#include "effect_class.h"

namespace smartmill::sim {

double BurstTrain::shape(double since) const {
  return std::exp(-since / decay) * std::sin(units::TWO_PI * frequency * since);
}

double BurstTrain::at(double time) const {
  const double since = std::fmod(time - first, period);
  return amplitude * shape(since < 0.0 ? since + period : since);
}

namespace {

/// Without a name: a channel rings every period; when, is another time each record.
class ChannelBursts : public Effect {
 public:
  explicit ChannelBursts(const EffectEntry& entry) {
    train_.channel = channelOf(wordOf(entry, "channel"));
    train_.period = valueOf(entry, "period_s");
    train_.frequency = valueOf(entry, "frequency_hz");
    train_.decay = valueOf(entry, "decay_s");
    train_.amplitude = valueOf(entry, "amplitude");
  }

  void measure(const Instant& now, ChannelValues& c) const override {
    if (train_.amplitude != 0.0) c[train_.channel] += train_.at(now.record_time);
  }
  BurstTrain* bursts() override { return &train_; }

 private:
  BurstTrain train_;
};

const EffectClass<ChannelBursts> REGISTERED("empirical:bursts");

}  // namespace
}  // namespace smartmill::sim
