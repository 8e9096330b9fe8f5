#include "smartmill_hammer/analysis/health_watch.h"

#include "smartmill_hammer/analysis/health.h"

namespace smartmill {
namespace hammer {

namespace {

constexpr double DAY = 86400.0;       // [s]
constexpr double AIR_AGAIN = 3600.0;  // [s] between two cuts in air that are told though nothing has changed

}  // namespace

std::optional<HealthReport> HealthWatch::measured(const MeasuredModes& modes) {
  const std::string key = modes.tool + " " + modes.point + " " + modes.direction;
  const auto [at, fresh] = modes_.try_emplace(key, Modes{modes, modes, ""});
  if (fresh) return {};
  Modes& known = at->second;
  known.drift = driftOf(modeChanges(known.last, modes));
  known.last = modes;
  return HealthReport{key, modes.stamp, (modes.stamp - known.first.stamp) / DAY,
                      modeChanges(known.first, modes)};
}

std::optional<HealthReport> HealthWatch::turned(const std::string& tool, const IdleRecord& seen) {
  const double stamp = endOf(seen);
  const auto [at, fresh] = air_.try_emplace(tool);
  Air& known = at->second;
  if (fresh) known.since = stamp;
  if (addSpeeds(known.first, seen)) return {};
  const std::vector<HealthChange> changes = idleChanges(known.first, seen, {});
  const std::string drift = driftOf(changes);
  const bool news = drift.empty() != known.drift.empty() || !known.told || stamp - *known.told > AIR_AGAIN;
  known.drift = drift;
  if (!news || changes.empty()) return {};
  known.told = stamp;
  return HealthReport{"spindle in air, " + (tool.empty() ? std::string("tool") : tool), stamp,
                      (stamp - known.since) / DAY, changes};
}

std::vector<std::string> HealthWatch::warnings() const {
  std::vector<std::string> all;
  for (const auto& [key, modes] : modes_) {
    if (!modes.drift.empty()) all.push_back(key + " differs from the last good measurement: " + modes.drift);
  }
  for (const auto& [tool, air] : air_) {
    if (!air.drift.empty())
      all.push_back("spindle in air with " + tool + " differs from the first time: " + air.drift);
  }
  return all;
}

}  // namespace hammer
}  // namespace smartmill
