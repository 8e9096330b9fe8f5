#include "model/effect_declaration.h"

#include <cmath>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/force_channels.h"

namespace smartmill::effects {

EffectKind empirical(const char* form_stage, const char* form, EffectStage stage, int rank) {
  EffectKind kind{std::string(EMPIRICAL) + ":" + form, stage, rank};
  kind.form_stage = form_stage;
  kind.form = form;
  return kind;
}

EffectParameter number(const char* key, const char* unit, const Range& range) {
  EffectParameter p;
  p.key = key;
  p.unit = unit;
  p.range = range;
  return p;
}

EffectParameter orZero(const char* key, const char* unit, const Range& range) {
  EffectParameter p = number(key, unit, range);
  p.optional = true;
  return p;
}

EffectParameter angle(const char* key) {
  EffectParameter p =
      number(key, "deg").drawn(0.0, 360.0).named("its direction, from tooth 1 in the direction of rotation");
  p.period = 360.0;
  p.on_spindle = true;
  return p;
}

EffectParameter angleOrZero(const char* key) {
  EffectParameter p = angle(key);
  p.on_spindle = false;
  p.optional = true;
  return p;
}

EffectParameter oneOf(const char* key, const std::vector<std::string>& words) {
  EffectParameter p = number(key, "1");
  p.value = EffectValue::word;
  p.words = words;
  return p;
}

EffectParameter oneOfNumbers(const char* key, const char* unit, const std::vector<double>& choices) {
  EffectParameter p = number(key, unit);
  p.choices = choices;
  return p;
}

EffectParameter perTooth(const char* key, const char* unit, const Range& range, std::optional<double> sum) {
  EffectParameter p = number(key, unit, range);
  p.value = EffectValue::list;
  p.sum = sum;
  return p;
}

EffectParameter series(const char* key, const char* unit, const Range& range) {
  EffectParameter p = number(key, unit, range);
  p.value = EffectValue::series;
  return p;
}

EffectParameter table(const char* key, const char* unit, const Range& range) {
  EffectParameter p = number(key, unit, range);
  p.value = EffectValue::table;
  return p;
}

EffectParameter tableOrNone(const char* key, const char* unit, const Range& range) {
  EffectParameter p = table(key, unit, range);
  p.optional = true;
  return p;
}

EffectParameter modes(const char* key) {
  EffectParameter p = number(key, "modes");
  p.value = EffectValue::modes;
  p.optional = true;
  return p;
}

const std::vector<std::string>& axisNames() {
  static const std::vector<std::string> NAMES(AXIS_NAMES.begin(), AXIS_NAMES.end());
  return NAMES;
}

const std::vector<std::string>& forceNames() {
  static const std::vector<std::string> NAMES(FORCE_CHANNELS.begin(), FORCE_CHANNELS.end());
  return NAMES;
}

const std::vector<std::string>& streamedChannels() {
  static const std::vector<std::string> NAMES{"fx", "fy", "fz", "load_meter"};
  return NAMES;
}

std::function<Forms(const Scope&)> always(const EffectForm& form) {
  return [form](const Scope&) { return Forms{form}; };
}

EffectCoordinates addedTo(double stated, const char* key, FitRange range) {
  range.low = -stated;
  return amplitude(key, range);
}

FitRange factorRange() {
  return {-1.6, 1.6, 1e-4, 0.5};
}

Forms onChannels(const Scope& scope, const std::function<EffectForm(const std::string&)>& form) {
  Forms forms;
  for (const std::string& channel : streamedChannels()) {
    if (scope.channels.count(channel)) forms.push_back(form(channel).word("channel", channel).named(channel));
  }
  return forms;
}

const std::vector<std::string>& clockNames() {
  static const std::vector<std::string> NAMES{"record", "machine"};
  return NAMES;
}

Forms onClocks(const Scope& scope, const std::function<EffectForm(const std::string&)>& form) {
  Forms forms;
  for (const std::string& clock : clockNames()) {
    if (clock != clockNames().front() && !scope.start_times) continue;
    for (EffectForm& one : onChannels(scope, form))
      forms.push_back(one.word("clock", clock).named(one.variant + ", " + clock));
  }
  return forms;
}

double unitOf(const std::string& channel) {
  return channel == "load_meter" ? 1e-3 : 1.0;
}

EffectForm exponentialApproach(const FitRange& size, double reach, double time) {
  EffectForm form({saturating("amplitude", "time_constant_s", time, size)});
  for (const double constants : {0.2, 0.6, 2.0, 10.0}) {
    const double share = std::exp(-1.0 / constants);
    form.probe({0.0, share}, {{reach, share}});
  }
  return form;
}

double between(EffectKind::Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

double eitherSign(EffectKind::Random& random, double low, double high) {
  const double size = between(random, low, high);
  return std::bernoulli_distribution(0.5)(random) ? size : -size;
}

double valueOf(const EffectEntry& entry, const char* key) {
  const auto found = entry.numbers.find(key);
  if (found == entry.numbers.end()) throw Error(std::string(key) + " is missing");
  return found->second;
}

const std::string& wordOf(const EffectEntry& entry, const char* key) {
  const auto found = entry.words.find(key);
  if (found == entry.words.end()) throw Error(std::string(key) + " is missing");
  return found->second;
}

const std::vector<double>& listOf(const EffectEntry& entry, const char* key) {
  const auto found = entry.lists.find(key);
  if (found == entry.lists.end() || found->second.empty()) throw Error(std::string(key) + " is missing");
  return found->second;
}

void checkTeeth(const char* effect, std::size_t values, const ToolGeometry& tool) {
  if (values != static_cast<std::size_t>(tool.teeth))
    throw Error(std::string(effect) + ": " + std::to_string(values) + " values, expected " +
                std::to_string(tool.teeth) + " (one per tooth)");
}

}  // namespace smartmill::effects
