#include "smartmill_hammer/analysis/health_watch.h"

#include "smartmill_hammer/analysis/health.h"

namespace smartmill::hammer {

std::optional<HealthReport> HealthWatch::addModes(const MeasuredModes& modes) {
  const std::string key = modes.tool + " " + modes.point + " " + modes.direction;
  const auto [at, fresh] = modes_.try_emplace(key, Modes{modes, modes, ""});
  if (fresh) return {};
  Modes& known = at->second;
  known.drift = driftText(modeChanges(known.last, modes));
  known.last = modes;
  return HealthReport{key, modes.stamp, (modes.stamp - known.first.stamp) / DAY,
                      modeChanges(known.first, modes)};
}

std::optional<HealthReport> HealthWatch::addAirCut(const std::string& tool, const AirCutRecord& record) {
  const double stamp = endTime(record);
  const auto [at, fresh] = air_cuts_.try_emplace(tool);
  AirCut& known = at->second;
  if (fresh) known.first_end = stamp;
  if (addNewSpeeds(known.first, record)) return {};
  const std::vector<HealthChange> changes = airCutChanges(known.first, record, {});
  const std::string drift = driftText(changes);
  const bool report = drift.empty() != known.drift.empty() || !known.last_report ||
                      stamp - *known.last_report > report_period_;
  known.drift = drift;
  if (!report || changes.empty()) return {};
  known.last_report = stamp;
  return HealthReport{"spindle in air, " + (tool.empty() ? std::string("tool") : tool), stamp,
                      (stamp - known.first_end) / DAY, changes};
}

std::vector<std::string> HealthWatch::warnings() const {
  std::vector<std::string> all;
  for (const auto& [key, modes] : modes_) {
    if (!modes.drift.empty()) all.push_back(key + " differs from the previous measurement: " + modes.drift);
  }
  for (const auto& [tool, air] : air_cuts_) {
    if (!air.drift.empty())
      all.push_back("spindle in air with " + tool + " differs from the first air cut: " + air.drift);
  }
  return all;
}

}  // namespace smartmill::hammer
