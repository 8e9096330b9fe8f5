#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Hum of the mains in phase on fx and fy; its phase is another one each record.
class MainsHum : public Effect {
 public:
  explicit MainsHum(const EffectEntry& entry) {
    tone_.frequency = valueOf(entry, "frequency_hz");
    tone_.amplitude[FX] = valueOf(entry, "amplitude_n");
    tone_.amplitude[FY] = valueOf(entry, "y_ratio") * tone_.amplitude[FX];
  }

  void measure(const Instant& now, ChannelValues& c) const override {
    const double wave = std::sin(units::TWO_PI * tone_.frequency * now.record_time + tone_.phase);
    c[FX] += tone_.amplitude[FX] * wave;
    c[FY] += tone_.amplitude[FY] * wave;
  }
  Tone* tone() override { return &tone_; }

 private:
  Tone tone_;
};

const EffectClass<MainsHum> REGISTERED("mains_hum");

}  // namespace
}  // namespace smartmill::sim
