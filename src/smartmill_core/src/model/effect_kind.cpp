#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"

namespace smartmill {

namespace {

using Random = EffectKind::Random;

const std::array<const char*, 10> STAGE_NAMES{{"geometry", "motion", "cutting law", "structure", "sensor",
                                               "sensor force", "drive", "sensor output", "delay", "signal"}};

double drawn(const EffectDraw& draw, Random& random) {
  const double size = std::uniform_real_distribution<double>(draw.low, draw.high)(random);
  const bool below = draw.both_sides && std::bernoulli_distribution(0.5)(random);
  return draw.about + (below ? -size : size);
}

template <class T>
T oneOf(const std::vector<T>& choices, std::size_t count, Random& random) {
  return choices[std::uniform_int_distribution<std::size_t>(0, count - 1)(random)];
}

bool anyModes(const ForceSensor& sensor) {
  return std::any_of(sensor.axis.begin(), sensor.axis.end(),
                     [](const ModalModel& axis) { return !axis.modes.empty(); });
}

std::optional<std::string> missingNeed(EffectNeed need, const EffectScope& scope) {
  const MachineModel& model = scope.nominal;
  const auto unless = [](bool met, const char* reason) {
    return met ? std::optional<std::string>() : std::string(reason);
  };
  const auto measured = [&](const char* channel) { return scope.channels.count(channel) > 0; };
  switch (need) {
    case EffectNeed::cuts:
      return unless(scope.cuts && model.tool, "");
    case EffectNeed::several_teeth:
      return unless(model.tool && model.tool->teeth > 1, "");
    case EffectNeed::forces:
      return unless(measured("fx") || measured("fy") || measured("fz"), "");
    case EffectNeed::plane_forces:
      return unless(measured("fx") || measured("fy"), "");
    case EffectNeed::load_meter:
      return unless(measured("load_meter") && model.spindle, "");
    case EffectNeed::flexible_tool:
      return unless(!model.tool_tip.x.modes.empty() || !model.tool_tip.y.modes.empty(),
                    "the model's tool is rigid");
    case EffectNeed::sensor_modes:
      return unless(anyModes(model.force_sensor), "the model's force sensor has no modes");
    case EffectNeed::start_time:
      return unless(scope.start_times, "start_time_s is not stated");
    case EffectNeed::cut_time:
      return unless(scope.cut_times, "cut_time_before_s is not stated");
    case EffectNeed::axis_motion:
      return unless(!scope.axes.empty(), "");
  }
  return {};
}

}  // namespace

const std::vector<std::string>& measuredChannels() {
  static const std::vector<std::string> CHANNELS{"fx",     "fy",     "fz",           "load_meter",
                                                 "tool_x", "tool_y", "displacement", "acceleration"};
  return CHANNELS;
}

const char* stageName(EffectStage stage) {
  return STAGE_NAMES[static_cast<std::size_t>(stage)];
}

bool isBehindSensor(EffectStage stage) {
  return stage == EffectStage::sensor || stage == EffectStage::sensor_output || stage == EffectStage::delay ||
         stage == EffectStage::signal;
}

bool EffectParameter::allows(double number) const {
  return choices.empty() ? range.contains(number)
                         : std::find(choices.begin(), choices.end(), number) != choices.end();
}

std::string EffectParameter::quantity() const {
  if (!name.empty()) return name;
  std::string suffix;  // as keys end in their unit: "_n_per_mm2" of "N/mm2"
  for (const char c : unit == "N m" ? std::string("nm") : unit)
    suffix += c == '/' ? "_per_" : c == ' ' ? "_" : std::string(1, static_cast<char>(std::tolower(c)));
  if (suffix.rfind("1_", 0) == 0) suffix.erase(0, 2);
  suffix.insert(0, "_");
  std::string text = key;
  if (text.size() > suffix.size() && text.compare(text.size() - suffix.size(), suffix.size(), suffix) == 0)
    text.resize(text.size() - suffix.size());
  std::replace(text.begin(), text.end(), '_', ' ');
  return text;
}

std::string EffectParameter::rangeText() const {
  if (choices.empty()) return range.text();
  std::string text;
  for (const double c : choices) text += (text.empty() ? "" : " or ") + shortNumber(c);
  return text;
}

double EffectParameter::difference(double number, double other) const {
  return period > 0.0 ? std::remainder(number - other, period) : number - other;
}

double EffectParameter::scale(double number) const {
  return period > 0.0 ? period / units::TWO_PI : number;
}

EffectParameter EffectParameter::drawn(double low, double high) const {
  EffectParameter p = *this;
  p.draw = {low, high, 0.0, false};
  return p;
}

EffectParameter EffectParameter::drawnOnBothSides(double low, double high, double about) const {
  EffectParameter p = *this;
  p.draw = {low, high, about, true};
  return p;
}

EffectParameter EffectParameter::drawnFromFirst(std::size_t count) const {
  EffectParameter p = *this;
  p.words_drawn = count;
  return p;
}

EffectParameter EffectParameter::named(const std::string& quantity) const {
  EffectParameter p = *this;
  p.name = quantity;
  return p;
}

bool EffectKind::has(EffectNeed need) const {
  return std::find(needs.begin(), needs.end(), need) != needs.end();
}

const EffectParameter* findParameter(const EffectKind& kind, const std::string& key) {
  for (const EffectParameter& parameter : kind.parameters) {
    if (parameter.key == key) return &parameter;
  }
  return nullptr;
}

const EffectParameter& parameterOf(const EffectKind& kind, const std::string& name) {
  const EffectParameter* parameter = findParameter(kind, name.substr(0, name.find('[')));
  if (!parameter) throw Error(kind.name + "." + name + ": no such key");
  return *parameter;
}

std::optional<std::string> missingNeed(const EffectKind& kind, const EffectScope& scope) {
  std::optional<std::string> reason;
  for (const EffectNeed need : kind.needs) {
    const std::optional<std::string> lacking = missingNeed(need, scope);
    if (lacking && lacking->empty()) return lacking;  // reported before any other reason
    if (lacking && !reason) reason = lacking;
  }
  return reason;
}

std::vector<EffectForm> formsOf(const EffectKind& kind, const EffectScope& scope) {
  std::vector<EffectForm> forms = kind.forms(scope);
  for (EffectForm& form : forms) {
    form.effect = kind.name;
    form.bic_penalty = kind.bic_penalty;
  }
  return forms;
}

EffectEntry effectEntry(const std::string& name, const std::map<std::string, double>& numbers,
                        const std::map<std::string, std::string>& words,
                        const std::map<std::string, std::vector<double>>& lists) {
  const EffectKind* kind = findEffect(name);
  if (!kind) throw Error("'" + name + "' is not an effect of the catalogue");
  const auto known = [&](const std::string& key, EffectValue value) -> const EffectParameter& {
    const EffectParameter* p = findParameter(*kind, key);
    if (!p || p->value != value) throw Error(name + "." + key + ": no such key of this type");
    return *p;
  };
  const auto check = [&](const EffectParameter& p, double value) {
    if (!p.allows(value)) throw Error(name + "." + p.key + ": " + yamlNumber(value) + " is out of range");
  };
  EffectEntry entry;
  entry.name = name;
  entry.numbers = numbers;
  entry.words = words;
  entry.lists = lists;
  for (const auto& [key, value] : numbers) check(known(key, EffectValue::number), value);
  for (const auto& [key, values] : lists) {
    const EffectParameter* p_of = findParameter(*kind, key);
    const bool any_length = p_of && (p_of->value == EffectValue::series || p_of->value == EffectValue::table);
    const EffectParameter& p = known(key, any_length ? p_of->value : EffectValue::list);
    for (const double value : values) check(p, value);
  }
  for (const auto& [key, word] : words) {
    const EffectParameter& p = known(key, EffectValue::word);
    if (std::find(p.words.begin(), p.words.end(), word) == p.words.end())
      throw Error(name + "." + key + ": '" + word + "' is not allowed");
  }
  for (const EffectParameter& p : kind->parameters) {
    if (p.value == EffectValue::number && p.optional) entry.numbers.emplace(p.key, 0.0);
    if (p.optional) continue;
    if (entry.numbers.count(p.key) + entry.words.count(p.key) + entry.lists.count(p.key) == 0)
      throw Error(name + "." + p.key + " is missing");
  }
  return entry;
}

EffectEntry drawEffect(const std::string& name, const MachineModel& machine, Random& random) {
  const EffectKind* kind = findEffect(name);
  if (!kind) throw Error("'" + name + "' is not an effect of the catalogue");
  EffectEntry entry;
  entry.name = name;
  for (const EffectParameter& p : kind->parameters) {
    if (p.value == EffectValue::word)
      entry.words[p.key] = oneOf(p.words, p.words_drawn ? p.words_drawn : p.words.size(), random);
    if (p.value != EffectValue::number) continue;
    entry.numbers[p.key] =
        p.choices.empty() ? drawn(p.draw, random) : oneOf(p.choices, p.choices.size(), random);
  }
  if (kind->draw) kind->draw(machine, random, entry);
  return entry;
}

std::string itemOf(const std::string& key, std::size_t item) {
  return key + "[" + std::to_string(item) + "]";
}

std::vector<std::pair<std::string, double>> numbersOf(const EffectEntry& entry) {
  std::vector<std::pair<std::string, double>> numbers(entry.numbers.begin(), entry.numbers.end());
  const EffectKind* kind = findEffect(entry.name);
  for (const auto& [key, list] : entry.lists) {
    const EffectParameter* p = kind ? findParameter(*kind, key) : nullptr;
    if (p && p->value == EffectValue::table) continue;
    for (std::size_t k = 0; k < list.size(); ++k) numbers.emplace_back(itemOf(key, k), list[k]);
  }
  const auto add = [&](const std::string& axis, const ModalModel& modes) {
    for (std::size_t k = 0; k < modes.modes.size(); ++k) {
      const std::string name = itemOf(axis, k) + ".";
      numbers.emplace_back(name + "frequency_hz", modes.modes[k].frequency);
      numbers.emplace_back(name + "damping_ratio", modes.modes[k].damping_ratio);
      numbers.emplace_back(name + "stiffness_n_per_um", 1e-6 / modes.modes[k].gain);
    }
  };
  add("x", entry.flexibility.x);
  add("y", entry.flexibility.y);
  return numbers;
}

}  // namespace smartmill
