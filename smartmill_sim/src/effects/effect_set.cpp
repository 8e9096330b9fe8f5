#include "smartmill_sim/effects/effect_set.h"

#include <algorithm>
#include <limits>
#include <tuple>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::sim {

bool actsIn(Stage stage, TestKind kind) {
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

EffectSet::EffectSet(const MachineModel& model) {
  using Listed = std::pair<const EffectKind*, const EffectEntry*>;
  std::vector<Listed> listed;
  for (const EffectEntry& entry : model.effects) {
    const EffectKind* kind = findEffect(entry.name);
    if (!kind) throw Error(model.file + ": effects: '" + entry.name + "' is not an effect of the catalogue");
    listed.emplace_back(kind, &entry);
  }
  // Within a stage empirical effects act first, so that the clipping of a signal is last.
  std::stable_sort(listed.begin(), listed.end(), [](const Listed& a, const Listed& b) {
    const auto order = [](const EffectKind& kind) {
      return std::make_tuple(kind.stage, !kind.empirical(), kind.rank, kind.name);
    };
    return order(*a.first) < order(*b.first);
  });
  for (const auto& [kind, entry] : listed) {
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
  ChannelValues limits;
  limits.fill(std::numeric_limits<double>::infinity());
  for (const Member& m : effects_) m.effect->applyLimit(limits);
  return limits;
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

std::vector<RecordZero*> EffectSet::zeros() {
  std::vector<RecordZero*> all;
  for (const Member& m : effects_) {
    if (RecordZero* zero = m.effect->zero()) all.push_back(zero);
  }
  return all;
}

void SignalStage::apply(double record_time, ChannelValues& channels) const {
  Instant at = now_;
  at.record_time = record_time;
  effects_.measure(Stage::signal, at, channels);
}

TwinSetup setUpOf(MachineModel model, const EffectSet& effects) {
  model.effects.clear();
  TwinSetup setup{std::move(model), {}, {}, 0.0, {}, {}, {}};
  if (setup.model.tool) setup.radius_offset.assign(static_cast<std::size_t>(setup.model.tool->teeth), 0.0);
  effects.setUp(setup);
  return setup;
}

}  // namespace smartmill::sim
