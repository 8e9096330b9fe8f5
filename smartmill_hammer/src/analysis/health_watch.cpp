#include "smartmill_hammer/analysis/health_watch.h"

#include "smartmill_hammer/analysis/health.h"

namespace smartmill {
namespace hammer {

void HealthWatch::measured(const MeasuredModes& modes) {
  const std::string key = modes.tool + " " + modes.point + " " + modes.direction;
  if (const auto before = last_.find(key); before != last_.end())
    drift_[key] = driftOf(modeChanges(before->second, modes));
  last_[key] = modes;
}

void HealthWatch::turned(const std::string& tool, const IdleRecord& seen) {
  IdleRecord& first = first_[tool];
  if (addSpeeds(first, seen)) return;
  idle_drift_[tool] = driftOf(idleChanges(first, seen, {}));
}

std::vector<std::string> HealthWatch::warnings() const {
  std::vector<std::string> all;
  for (const auto& [key, drift] : drift_) {
    if (!drift.empty()) all.push_back(key + " differs from the last good measurement: " + drift);
  }
  for (const auto& [tool, drift] : idle_drift_) {
    if (!drift.empty())
      all.push_back("spindle in air with " + tool + " differs from the first time: " + drift);
  }
  return all;
}

}  // namespace hammer
}  // namespace smartmill
