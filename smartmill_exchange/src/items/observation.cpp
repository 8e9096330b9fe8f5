#include "smartmill_exchange/items/observation.h"

#include <algorithm>
#include <cmath>
#include <ctime>

#include "smartmill_core/formatted.h"
#include "smartmill_exchange/items/asset.h"

namespace smartmill::exchange {
namespace {

constexpr double YEAR_10000 = 253402300800.0;  // [s] since 1970

const Activation* find(const Activations& list, const std::string& code) {
  const auto found =
      std::find_if(list.begin(), list.end(), [&](const Activation& a) { return a.code == code; });
  return found == list.end() ? nullptr : &*found;
}

}  // namespace

Value numberOrNone(double value) {
  return std::isfinite(value) ? Value(value) : Value(Unavailable{});
}

std::string numberText(double value) {
  return formatted("%.9g", value == 0.0 ? 0.0 : value);  // no -0
}

std::string timeText(double time) {
  const double bounded = std::isfinite(time) ? std::clamp(time, 0.0, YEAR_10000 - 1.0) : 0.0;
  const auto microseconds = static_cast<long long>(std::llround(1e6 * bounded));
  const auto seconds = static_cast<std::time_t>(microseconds / 1000000);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  return formatted("%04d-%02d-%02dT%02d:%02d:%02d.%06dZ", parts.tm_year + 1900, parts.tm_mon + 1,
                   parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec,
                   static_cast<int>(microseconds % 1000000));
}

std::vector<ConditionChange> changesOf(const Value& before, const Value& after) {
  using Level = ConditionChange::Level;
  const auto* now = std::get_if<Activations>(&after);
  if (!now) return {{Level::unavailable, {}, {}}};
  if (now->empty()) return {{Level::normal, {}, {}}};
  static const Activations NOTHING;
  const auto* last = std::get_if<Activations>(&before);
  if (!last) last = &NOTHING;
  std::vector<ConditionChange> changes;
  for (const Activation& gone : *last)
    if (!find(*now, gone.code)) changes.push_back({Level::normal, gone.code, {}});
  for (const Activation& active : *now) {
    const Activation* same = find(*last, active.code);
    if (!same || !(*same == active))
      changes.push_back({active.fault ? Level::fault : Level::warning, active.code, active.text});
  }
  return changes;
}

std::string assetId(const std::vector<std::string>& words) {
  std::string id;
  for (const std::string& word : words) {
    if (word.empty()) continue;
    if (!id.empty()) id += '.';
    for (const char c : word) {
      const bool plain = std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '.' || c == '_';
      id += plain ? c : '_';
    }
  }
  return id;
}

}  // namespace smartmill::exchange
