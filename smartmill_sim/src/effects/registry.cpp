#include <algorithm>
#include <string>

#include "classes.h"
#include "smartmill_core/error.h"
#include "smartmill_sim/effects/effect.h"

namespace smartmill::sim {
namespace {

const std::array<const char*, CHANNELS> CHANNEL_NAMES{
    {"fx", "fy", "fz", "load_meter", "tool_x", "tool_y", "displacement", "acceleration"}};
const std::array<const char*, 10> STAGE_NAMES{{"geometry", "motion", "cutting law", "structure", "sensor",
                                               "sensor force", "drive", "sensor output", "delay", "signal"}};

std::size_t rankOf(const std::string& name) {
  const std::vector<EffectClass>& all = effectRegistry();
  std::size_t rank = 0;
  while (rank < all.size() && all[rank].name != name) ++rank;
  return rank;
}

}  // namespace

const std::vector<EffectClass>& effectRegistry() {
  static const std::vector<EffectClass> REGISTRY{
      {"uneven_pitch", Stage::geometry, makeUnevenPitch},
      {"runout", Stage::geometry, makeRunout},
      {"helix", Stage::geometry, makeHelix},
      {"feed_error", Stage::motion, makeFeedError},
      {"depth_tilt", Stage::motion, makeDepthTilt},
      {"edge_forces", Stage::cutting_law, makeEdgeForces},
      {"size_effect", Stage::cutting_law, makeSizeEffect},
      {"cutting_speed", Stage::cutting_law, makeCuttingSpeed},
      {"chip_coefficients", Stage::cutting_law, makeChipCoefficients},
      {"edge_buildup", Stage::cutting_law, makeEdgeBuildup},
      {"tool_wear", Stage::cutting_law, makeToolWear},
      {"process_damping", Stage::cutting_law, makeProcessDamping},
      {"tool_flexibility", Stage::structure, makeToolFlexibility},
      {"mass_loading", Stage::sensor, makeMassLoading},
      {"speed_dependent_mode", Stage::sensor, makeSpeedDependentMode},
      {"extra_mode", Stage::sensor, makeExtraMode},
      {"unbalance", Stage::sensor_force, makeUnbalance},
      {"spindle_order", Stage::sensor_force, makeSpindleOrder},
      {"stribeck_friction", Stage::drive, makeStribeckFriction},
      {"friction_warmup", Stage::drive, makeFrictionWarmup},
      {"load_meter_lag", Stage::drive, makeLoadMeterLag},
      {"cross_talk", Stage::sensor_output, makeCrossTalk},
      {"gain_error", Stage::sensor_output, makeGainError},
      {"channel_delay", Stage::delay, makeChannelDelay},
      {"zero_offset", Stage::signal, makeZeroOffset},
      {"charge_drift", Stage::signal, makeChargeDrift},
      {"mains_hum", Stage::signal, makeMainsHum},
      {"saturation", Stage::signal, makeSaturation},
  };
  return REGISTRY;
}

const EffectClass* findEffectClass(const std::string& name) {
  const std::size_t rank = rankOf(name);
  return rank < effectRegistry().size() ? &effectRegistry()[rank] : nullptr;
}

const char* stageName(Stage stage) {
  return STAGE_NAMES[static_cast<std::size_t>(stage)];
}

const char* channelName(std::size_t channel) {
  return CHANNEL_NAMES.at(channel);
}

std::size_t channelOf(const std::string& name) {
  for (std::size_t c = 0; c < CHANNELS; ++c) {
    if (name == CHANNEL_NAMES[c]) return c;
  }
  throw Error("'" + name + "' is no channel");
}

EffectSet::EffectSet(const MachineModel& model) {
  std::vector<const EffectEntry*> entries;
  for (const EffectEntry& entry : model.effects) entries.push_back(&entry);
  std::stable_sort(entries.begin(), entries.end(), [](const EffectEntry* a, const EffectEntry* b) {
    return rankOf(a->name) < rankOf(b->name);
  });
  for (const EffectEntry* entry : entries) {
    const EffectClass* found = findEffectClass(entry->name);
    if (!found) throw Error(model.file + ": effect '" + entry->name + "' is not simulated");
    try {
      effects_.push_back({found->stage, found->make(*entry)});
    } catch (const Error& e) {
      throw Error(model.file + ": effects: " + entry->name + ": " + e.what());
    }
    has_[static_cast<std::size_t>(found->stage)] = true;
  }
}

bool EffectSet::has(Stage stage) const {
  return has_[static_cast<std::size_t>(stage)];
}

void EffectSet::setUp(TwinSetup& setup) const {
  for (const Member& m : effects_) m.effect->setUp(setup);
}

void EffectSet::update(const Instant& now, TwinState& state) const {
  for (const Member& m : effects_) m.effect->update(now, state);
}

void EffectSet::addForce(const Instant& now, Axes3& force) const {
  for (const Member& m : effects_) m.effect->addForce(now, force);
}

void EffectSet::measure(Stage stage, const Instant& now, ChannelValues& channels) const {
  for (const Member& m : effects_) {
    if (m.stage == stage) m.effect->measure(now, channels);
  }
}

std::vector<Tone*> EffectSet::tones() {
  std::vector<Tone*> tones;
  for (const Member& m : effects_) {
    if (Tone* tone = m.effect->tone()) tones.push_back(tone);
  }
  return tones;
}

EffectEntry effectEntry(const std::string& name, const std::map<std::string, double>& numbers,
                        const std::map<std::string, std::string>& words) {
  const EffectKind* kind = findEffect(name);
  if (!kind) throw Error("'" + name + "' is no effect of the catalogue");
  EffectEntry entry;
  entry.name = name;
  for (const auto& [key, value] : numbers) {
    const EffectParameter* p = findParameter(*kind, key);
    if (!p || p->value != EffectValue::number) throw Error(name + "." + key + ": no such number");
    const bool chosen =
        p->choices.empty() || std::find(p->choices.begin(), p->choices.end(), value) != p->choices.end();
    if (!p->range.contains(value) || !chosen)
      throw Error(name + "." + key + ": " + yamlNumber(value) + " is out of range");
    entry.numbers[key] = value;
  }
  for (const auto& [key, word] : words) {
    const EffectParameter* p = findParameter(*kind, key);
    if (!p || std::find(p->words.begin(), p->words.end(), word) == p->words.end())
      throw Error(name + "." + key + ": '" + word + "' is not allowed");
    entry.words[key] = word;
  }
  for (const EffectParameter& p : kind->parameters) {
    if (p.value == EffectValue::number && p.optional) entry.numbers.emplace(p.key, 0.0);
    const bool number_missing = p.value == EffectValue::number && entry.numbers.count(p.key) == 0;
    const bool word_missing = p.value == EffectValue::word && entry.words.count(p.key) == 0;
    if (number_missing || word_missing) throw Error(name + "." + p.key + " is missing");
  }
  return entry;
}

}  // namespace smartmill::sim
