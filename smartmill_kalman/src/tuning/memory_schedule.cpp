#include "smartmill_kalman/tuning/memory_schedule.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/gain_schedule.h"

namespace smartmill::kalman {
namespace {

constexpr const char* FORMAT = "smartmill-memory/1";
/// [1] Gains are designed on this grid of speeds: the last tuned speed is inside.
constexpr double ROUNDING = GainScheduleOptions().spacing;

/// Neighbours of a speed, and the share of the second.
struct Neighbours {
  const TunedMemory *below, *above;
  double share;
};

std::optional<Neighbours> neighboursOf(const std::vector<TunedMemory>& points, double speed) {
  if (points.empty() || speed < points.front().speed * (1.0 - ROUNDING) ||
      speed > points.back().speed * (1.0 + ROUNDING))
    return std::nullopt;
  const auto above = std::lower_bound(points.begin(), points.end(), speed,
                                      [](const TunedMemory& point, double at) { return point.speed < at; });
  if (above == points.begin()) return Neighbours{&points.front(), &points.front(), 0.0};
  if (above == points.end()) return Neighbours{&points.back(), &points.back(), 0.0};
  const TunedMemory& below = *(above - 1);
  return Neighbours{&below, &*above, std::log(speed / below.speed) / std::log(above->speed / below.speed)};
}

}  // namespace

std::optional<double> MemorySchedule::memory(std::size_t a, double speed) const {
  const auto near = neighboursOf(axis.at(a), speed);
  if (!near || !near->below->memory || !near->above->memory) return std::nullopt;
  return *near->below->memory * std::pow(*near->above->memory / *near->below->memory, near->share);
}

std::optional<double> MemorySchedule::error(std::size_t a, double speed) const {
  const auto near = neighboursOf(axis.at(a), speed);
  if (!near) return std::nullopt;
  return near->below->error + near->share * (near->above->error - near->below->error);
}

std::string describe(const MemorySchedule& schedule) {
  std::string text = "expected RMS force error x, y, z, tuned (fixed) [N]:";
  for (std::size_t k = 0; k < schedule.axis[0].size(); ++k) {
    text += formatted("%s %.0f rpm", k == 0 ? "" : ";", units::rpmFromRadPerSec(schedule.axis[0][k].speed));
    for (const std::vector<TunedMemory>& points : schedule.axis)
      text += formatted(" %.2f (%.2f)", points[k].error, points[k].fixed_error);
  }
  return text;
}

MemorySchedule readMemorySection(const StrictYaml& section) {
  MemorySchedule schedule;
  for (std::size_t a = 0; a < 3; ++a) {
    for (const StrictYaml& entry : section.maps(AXIS_NAMES[a])) {
      TunedMemory point;
      point.speed = units::radPerSecFromRpm(entry.number("speed_rpm", Range::positive()));
      point.memory = entry.optionalNumber("memory_revolutions", Range::positive());
      point.error = entry.number("error_n", Range::notNegative());
      point.fixed_error = entry.number("fixed_error_n", Range::notNegative());
      entry.finish();
      if (!schedule.axis[a].empty() && !(point.speed > schedule.axis[a].back().speed))
        entry.fail("speed_rpm", "expected ascending speeds");
      schedule.axis[a].push_back(point);
    }
    if (schedule.axis[a].size() != schedule.axis[0].size())
      section.fail(AXIS_NAMES[a], "expected as many speeds as x");
  }
  section.finish();
  return schedule;
}

std::string memorySection(const MemorySchedule& schedule) {
  if (schedule.empty()) return "";
  std::string out =
      "# process noise over the spindle speed: q = r dt / tau^2, tau in revolutions (none: fixed design);\n"
      "# expected RMS force error with it and with the fixed design\n"
      "memory_over_speed:\n";
  for (std::size_t a = 0; a < 3; ++a) {
    out += std::string("  ") + AXIS_NAMES[a] + ":\n";
    for (const TunedMemory& point : schedule.axis[a]) {
      out += "  - {speed_rpm: " + yamlNumber(units::rpmFromRadPerSec(point.speed));
      if (point.memory) out += ", memory_revolutions: " + yamlNumber(*point.memory);
      out += ", error_n: " + yamlNumber(point.error) + ", fixed_error_n: " + yamlNumber(point.fixed_error) +
             "}\n";
    }
  }
  return out;
}

MemorySchedule readMemorySchedule(const std::string& file) {
  const StrictYaml yaml = StrictYaml::fromFile(file);
  yaml.oneOf("format", {FORMAT});
  MemorySchedule schedule = readMemorySection(yaml.map("memory_over_speed"));
  yaml.finish();
  return schedule;
}

void writeMemorySchedule(const MemorySchedule& schedule, const std::string& file) {
  std::ofstream stream(file);
  stream << "format: " << FORMAT << "\n" << memorySection(schedule);
  stream.close();
  if (!stream) throw Error(file + ": cannot write");
}

}  // namespace smartmill::kalman
