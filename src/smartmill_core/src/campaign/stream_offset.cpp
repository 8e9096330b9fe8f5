#include "smartmill_core/campaign/stream_offset.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/signal/interpolate.h"

namespace smartmill {

namespace {

double offsetOf(const std::string& column, const CampaignTest& test) {
  for (const auto& [group, offset] : test.stream_offset) {
    if (streamGroups().at(group).count(column)) return offset;
  }
  return 0.0;
}

// @param later [samples]
double at(const std::vector<double>& samples, std::size_t i, double later) {
  const double place = static_cast<double>(i) + later, whole = std::floor(place);
  const auto sample = [&](double k) {
    return samples[static_cast<std::size_t>(std::clamp(k, 0.0, static_cast<double>(samples.size() - 1)))];
  };
  return catmullRom(sample(whole - 1.0), sample(whole), sample(whole + 1.0), sample(whole + 2.0),
                    place - whole);
}

}  // namespace

const std::map<std::string, std::set<std::string>>& streamGroups() {
  static const std::map<std::string, std::set<std::string>> GROUPS{
      {"force", {FORCE_CHANNELS.begin(), FORCE_CHANNELS.end()}},
      {"controller",
       {"axis_x", "axis_y", "axis_z", "axis_vx", "axis_vy", "axis_vz", "current_x", "current_y", "current_z",
        "load_meter"}},
      {"tool", {"tool_x", "tool_y", "displacement", "acceleration"}}};
  return GROUPS;
}

Record aligned(const Record& record, const CampaignTest& test) {
  double earliest = 0.0, latest = 0.0;  // [samples]
  for (const std::string& name : record.names) {
    const double later = offsetOf(name, test) * test.sample_rate;
    earliest = std::min(earliest, later);
    latest = std::max(latest, later);
  }
  if (earliest == 0.0 && latest == 0.0) return record;
  const double first = std::ceil(-earliest), end = static_cast<double>(record.size()) - std::ceil(latest);
  if (end - first < 2.0)
    throw Error(record.file + formatted(": stream_offset_s of %.6g s is longer than the record",
                                        std::max(-earliest, latest) / test.sample_rate));
  Record result;
  result.file = record.file;
  result.notes = record.notes;
  const auto begin = static_cast<std::size_t>(first), size = static_cast<std::size_t>(end - first);
  for (std::size_t i = 0; i < size; ++i) result.time.push_back(record.time[begin + i]);
  for (std::size_t c = 0; c < record.names.size(); ++c) {
    const double later = offsetOf(record.names[c], test) * test.sample_rate;
    std::vector<double>& column = result.add(record.names[c]);
    for (std::size_t i = 0; i < size; ++i)
      column.push_back(later == 0.0 ? record.columns[c][begin + i] : at(record.columns[c], begin + i, later));
  }
  return result;
}

}  // namespace smartmill
