#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Time [s] by the clock of an effect on a channel.
class ChannelClock {
 public:
  explicit ChannelClock(const EffectEntry& entry) : record_(wordOf(entry, "clock") == "record") {}
  double operator()(const Instant& now) const {
    return record_ ? now.record_time : now.start_time + now.record_time;
  }

 private:
  bool record_;  // not since the machine was cold
};

/// Without a name: a channel is off from a time on.
class ChannelStep : public Effect {
 public:
  explicit ChannelStep(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))),
        clock_(entry),
        at_(valueOf(entry, "at_s")),
        amplitude_(valueOf(entry, "amplitude")) {}

  void measure(const Instant& now, ChannelValues& c) const override {
    if (clock_(now) >= at_) c[channel_] += amplitude_;
  }

 private:
  std::size_t channel_;
  ChannelClock clock_;
  double at_, amplitude_;  // [s], [unit of the channel]
};

/// Without a name: a channel drifts in a straight line.
class ChannelRamp : public Effect {
 public:
  explicit ChannelRamp(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))),
        clock_(entry),
        rate_(valueOf(entry, "per_min") / 60.0) {}

  void measure(const Instant& now, ChannelValues& c) const override { c[channel_] += rate_ * clock_(now); }

 private:
  std::size_t channel_;
  ChannelClock clock_;
  double rate_;  // [unit of the channel / s]
};

/// Without a name: a channel comes to be off while the machine warms up.
class ChannelApproach : public Effect {
 public:
  explicit ChannelApproach(const EffectEntry& entry)
      : channel_(channelOf(wordOf(entry, "channel"))),
        amplitude_(valueOf(entry, "amplitude")),
        constant_(valueOf(entry, "time_constant_s")) {}

  void measure(const Instant& now, ChannelValues& c) const override {
    c[channel_] -= amplitude_ * std::expm1(-(now.start_time + now.record_time) / constant_);
  }

 private:
  std::size_t channel_;
  double amplitude_, constant_;  // [unit of the channel], [s]
};

const EffectClass<ChannelStep> STEP("empirical:step");
const EffectClass<ChannelRamp> RAMP("empirical:ramp");
const EffectClass<ChannelApproach> APPROACH("empirical:approach");

}  // namespace
}  // namespace smartmill::sim
