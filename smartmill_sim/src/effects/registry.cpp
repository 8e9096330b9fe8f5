#include <algorithm>
#include <limits>
#include <map>
#include <string>
#include <utility>

#include "effect_class.h"
#include "smartmill_core/error.h"
#include "smartmill_sim/effects/effect.h"

namespace smartmill::sim {
namespace {

std::map<std::string, EffectMaker>& classes() {
  static std::map<std::string, EffectMaker> all;
  return all;
}

// In the order of the stages, then of the catalogue; causes without a name first, for nothing is behind a
// clipped signal. Unknown: last.
std::pair<int, std::size_t> rankOf(const std::string& name) {
  const EffectKind* kind = findEffect(name);
  if (!kind) return {static_cast<int>(Stage::signal) + 1, 0};
  const auto& all = kind->empirical() ? empiricalCatalogue() : effectCatalogue();
  const auto place = static_cast<std::size_t>(kind - all.data());
  return {static_cast<int>(kind->stage), kind->empirical() ? place : place + empiricalCatalogue().size()};
}

}  // namespace

EffectRegistration::EffectRegistration(const char* name, EffectMaker make) {
  classes()[name] = make;
}

std::unique_ptr<Effect> makeEffect(const EffectEntry& entry) {
  const auto found = classes().find(entry.name);
  if (found == classes().end()) throw Error("is not simulated");
  return found->second(entry);
}

bool touches(Stage stage, TestKind kind) {
  switch (stage) {
    case Stage::geometry:
    case Stage::motion:
    case Stage::cutting_law:
      return kind == TestKind::cut;
    case Stage::drive:
      return kind != TestKind::tap;
    default:
      return true;
  }
}

const char* channelName(std::size_t channel) {
  return measuredChannels().at(channel).c_str();
}

std::size_t channelOf(const std::string& name) {
  const std::vector<std::string>& names = measuredChannels();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw Error("'" + name + "' is no channel");
  return static_cast<std::size_t>(found - names.begin());
}

EffectSet::EffectSet(const MachineModel& model) {
  std::vector<const EffectEntry*> entries;
  for (const EffectEntry& entry : model.effects) entries.push_back(&entry);
  std::stable_sort(entries.begin(), entries.end(), [](const EffectEntry* a, const EffectEntry* b) {
    return rankOf(a->name) < rankOf(b->name);
  });
  for (const EffectEntry* entry : entries) {
    const EffectKind* kind = findEffect(entry->name);
    if (!kind) throw Error(model.file + ": effects: '" + entry->name + "' is no effect of the catalogue");
    try {
      effects_.push_back({kind->stage, makeEffect(*entry)});
    } catch (const Error& e) {
      throw Error(model.file + ": effects: " + entry->name + ": " + e.what());
    }
    has_[static_cast<std::size_t>(kind->stage)] = true;
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

ChannelValues EffectSet::limits() const {
  ChannelValues most;
  most.fill(std::numeric_limits<double>::infinity());
  for (const Member& m : effects_) m.effect->limit(most);
  return most;
}

std::vector<Tone*> EffectSet::tones() {
  std::vector<Tone*> tones;
  for (const Member& m : effects_) {
    if (Tone* tone = m.effect->tone()) tones.push_back(tone);
  }
  return tones;
}

std::vector<BurstTrain*> EffectSet::bursts() {
  std::vector<BurstTrain*> all;
  for (const Member& m : effects_) {
    if (BurstTrain* bursts = m.effect->bursts()) all.push_back(bursts);
  }
  return all;
}

TwinSetup setUpOf(MachineModel model, const EffectSet& effects) {
  model.effects.clear();
  TwinSetup setup{std::move(model), {}, {}, 0.0, 0.0, {}, {}, {}};
  if (setup.model.tool) setup.radius_offset.assign(static_cast<std::size_t>(setup.model.tool->teeth), 0.0);
  effects.setUp(setup);
  return setup;
}

}  // namespace smartmill::sim
