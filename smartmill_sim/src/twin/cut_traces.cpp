#include "smartmill_sim/twin/cut_traces.h"

#include <algorithm>
#include <functional>
#include <string>

#include "smartmill_sim/effects/effect_set.h"

namespace smartmill::sim {
namespace {

using Values = std::vector<double>;

double hashOf(const std::string& text) {
  return static_cast<double>(std::hash<std::string>()(text));
}

void append(Values& values, const ModalModel& modes) {
  values.push_back(static_cast<double>(modes.modes.size()));
  for (const Mode& m : modes.modes) values.insert(values.end(), {m.frequency, m.damping_ratio, m.gain});
  values.push_back(modes.direct);
}

void append(Values& values, const std::vector<WorkpieceModes>& places) {
  for (const WorkpieceModes& place : places) {
    append(values, place.x);
    append(values, place.y);
  }
}

void append(Values& values, const EffectEntry& effect) {
  values.push_back(hashOf(effect.name));
  for (const auto& [name, value] : effect.numbers) values.insert(values.end(), {hashOf(name), value});
  for (const auto& [name, word] : effect.words) values.push_back(hashOf(name + "=" + word));
  for (const auto& [name, list] : effect.lists) {
    values.push_back(hashOf(name));
    values.insert(values.end(), list.begin(), list.end());
  }
  append(values, effect.flexibility.x);
  append(values, effect.flexibility.y);
}

void appendTool(Values& values, const MachineModel& model) {
  if (const auto& t = model.tool) {
    values.insert(values.end(), {static_cast<double>(t->teeth), t->diameter, t->helix});
    values.insert(values.end(), t->pitch.begin(), t->pitch.end());
    const EdgeShape& edge = t->edge;
    values.insert(values.end(), {edge.corner_radius, edge.edge_angle, edge.serration_amplitude,
                                 edge.serration_wavelength, static_cast<double>(edge.helix.size())});
    values.insert(values.end(), edge.helix.begin(), edge.helix.end());
  }
}

void appendCutting(Values& values, const MachineModel& model) {
  if (const auto& c = model.cutting)
    values.insert(values.end(), {c->ktc, c->krc, c->kac, c->kte, c->kre, c->kae});
}

void appendSpindle(Values& values, const MachineModel& model) {
  if (const auto& s = model.spindle)
    values.insert(values.end(), {s->viscous, s->coulomb, s->load_meter_gain, s->load_meter_bandwidth,
                                 s->load_meter_resolution, s->friction_zero_below});
}

void appendCut(Values& values, const MachineModel& model, TestKind kind) {
  if (kind == TestKind::cut) {
    appendTool(values, model);
    appendCutting(values, model);
  }
  append(values, model.tool_tip.x);
  append(values, model.tool_tip.y);
  append(values, model.workpiece_modes);
}

bool actsOnCut(Stage stage) {
  return stage == Stage::geometry || stage == Stage::motion || stage == Stage::cutting_law ||
         stage == Stage::structure;
}

// Whether an effect may act on a channel, for effects that do not mix channels.
bool actsOn(const EffectEntry& effect, Stage stage, std::size_t channel) {
  const auto matches = [&](const char* key, const std::string& word) {
    const auto found = effect.words.find(key);
    return found == effect.words.end() || found->second == word;
  };
  const bool force = channel <= FZ;
  if (actsOnCut(stage)) return true;
  if (stage == Stage::drive) return channel == LOAD_METER;
  if (stage == Stage::sensor || stage == Stage::sensor_force)
    return force && matches("axis", std::string(1, "xyz"[channel]));
  return matches("channel", channelName(channel));
}

}  // namespace

Values valuesOfRecord(const MachineModel& model, TestKind kind) {
  Values values;
  appendCut(values, model, kind);
  for (const ModalModel& a : model.force_sensor.axis) append(values, a);
  if (kind != TestKind::tap) appendSpindle(values, model);
  for (const EffectEntry& effect : model.effects) {
    const EffectKind* known = findEffect(effect.name);
    if (!known || actsIn(known->stage, kind)) append(values, effect);
  }
  return values;
}

bool channelsAreIndependent(const MachineModel& model) {
  return std::none_of(model.effects.begin(), model.effects.end(), [](const EffectEntry& effect) {
    const EffectKind* known = findEffect(effect.name);
    if (!known) return true;
    const bool acts_on_channels =
        known->stage == Stage::sensor_output || known->stage == Stage::delay || known->stage == Stage::signal;
    const bool from_another = effect.words.count("from") > 0;
    return acts_on_channels && (from_another || effect.words.count("channel") == 0);
  });
}

Values valuesOfChannel(const MachineModel& model, TestKind kind, std::size_t channel) {
  Values values;
  appendCut(values, model, kind);
  if (channel <= FZ) append(values, model.force_sensor.axis[channel]);
  if (channel == LOAD_METER && kind != TestKind::tap) appendSpindle(values, model);
  for (const EffectEntry& effect : model.effects) {
    const EffectKind& known = *findEffect(effect.name);
    if (actsIn(known.stage, kind) && actsOn(effect, known.stage, channel)) append(values, effect);
  }
  return values;
}

Values valuesOfTrace(const MachineModel& model, TestKind kind, bool tip_prescribed) {
  Values values;
  const bool cut = kind == TestKind::cut;
  bool rigid =
      model.tool_tip.x.modes.empty() && model.tool_tip.y.modes.empty() && model.workpiece_modes.empty();
  for (const EffectEntry& effect : model.effects)
    rigid = rigid && effect.flexibility.x.modes.empty() && effect.flexibility.y.modes.empty();
  const bool sums = rigid || tip_prescribed;
  values.push_back(sums ? 1.0 : 0.0);
  if (cut) appendTool(values, model);
  if (cut && !sums) appendCutting(values, model);
  if (!tip_prescribed) append(values, model.tool_tip.x);
  if (!tip_prescribed) append(values, model.tool_tip.y);
  if (!tip_prescribed) append(values, model.workpiece_modes);
  for (const EffectEntry& effect : model.effects) {
    const EffectKind* known = findEffect(effect.name);
    if (known && (!actsOnCut(known->stage) || !actsIn(known->stage, kind))) continue;
    if (known && tip_prescribed && known->stage == Stage::structure) continue;
    if (sums && known && known->stage == Stage::cutting_law && makeEffect(effect)->scalesForce()) continue;
    append(values, effect);
  }
  return values;
}

std::shared_ptr<const CutTrace> CutTraces::find(const Values& values) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (std::size_t k = 0; k < entries_.size(); ++k) {
    if (entries_[k].first != values) continue;
    auto found = std::move(entries_[k]);
    entries_.erase(entries_.begin() + static_cast<std::ptrdiff_t>(k));
    entries_.push_front(std::move(found));
    return entries_.front().second;
  }
  return nullptr;
}

void CutTraces::insert(Values values, std::shared_ptr<const CutTrace> trace) {
  const std::lock_guard<std::mutex> lock(mutex_);
  entries_.emplace_front(std::move(values), std::move(trace));
  if (entries_.size() > capacity_) entries_.pop_back();
}

void CutTraces::clear() {
  const std::lock_guard<std::mutex> lock(mutex_);
  entries_.clear();
}

}  // namespace smartmill::sim
