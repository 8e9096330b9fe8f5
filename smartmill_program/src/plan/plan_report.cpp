#include "smartmill_program/plan/plan_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "feed_words.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::MM;

constexpr std::size_t CONTEXT = 3;        // lines around a difference
constexpr double MM_PER_MIN = MM / 60.0;  // [m/s]

std::string timeLine(const char* what, double before, double after) {
  return formatted("time %s: %.1f s before, %.1f s after, %.1f s saved (%.1f %%)\n", what, before, after,
                   before - after, before > 0.0 ? 100.0 * (before - after) / before : 0.0);
}

/// "limit that binds: force 70.1 %, chip 29.9 % of the time at feed"
std::string shares(const FeedPlan& plan) {
  std::array<double, FEED_LIMITS> time{};
  for (const PlannedBlock& block : plan.blocks) time[static_cast<std::size_t>(block.limit)] += block.new_time;
  const double sum = std::accumulate(time.begin(), time.end(), 0.0);
  std::vector<std::size_t> order(FEED_LIMITS);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return time[a] > time[b]; });
  std::vector<std::string> parts;
  for (const std::size_t i : order)
    if (time[i] > 0.0)
      parts.push_back(formatted("%s %.1f %%", nameOf(static_cast<FeedLimit>(i)), 100.0 * time[i] / sum));
  return "limit that binds: " + joined(parts) + " of the time at feed\n";
}

/// The blocks whose value is below a limit, with the first of them; empty: none is.
std::string blocksBelow(const FeedPlan& plan, double PlannedBlock::*value, double limit, double unit,
                        const char* what, const char* name_of_unit) {
  const PlannedBlock* first = nullptr;
  std::size_t count = 0;
  for (const PlannedBlock& block : plan.blocks) {
    if (!(block.*value < limit)) continue;
    if (!first) first = &block;
    ++count;
  }
  if (!first) return "";
  return formatted("%s below %.4g%s in %zu blocks, first in line %d: %.4g%s\n", what, limit / unit,
                   name_of_unit, count, first->line, first->*value / unit, name_of_unit);
}

}  // namespace

// The texts have the same number of lines.
std::string planDiff(const std::string& text, const std::string& planned, const std::string& name,
                     const std::string& name_of_plan) {
  const std::vector<std::string> old_lines = linesOf(text), new_lines = linesOf(planned);
  std::string diff;
  const auto write = [&](char mark, const std::string& line) {
    diff += mark + line;
    if (line.empty() || line.back() != '\n') diff += "\n\\ No newline at end of file\n";
  };
  const std::size_t size = old_lines.size();
  std::vector<std::size_t> changed;
  for (std::size_t i = 0; i < size; ++i)
    if (old_lines[i] != new_lines[i]) changed.push_back(i);
  if (changed.empty()) return "";
  diff = "--- " + name + "\n+++ " + name_of_plan + "\n";
  for (std::size_t first = 0; first < changed.size();) {
    // Changes whose contexts touch are one hunk.
    std::size_t last = first;
    while (last + 1 < changed.size() && changed[last + 1] - changed[last] <= 2 * CONTEXT + 1) ++last;
    const std::size_t from = changed[first] - std::min(changed[first], CONTEXT),
                      to = std::min(size, changed[last] + CONTEXT + 1);
    const std::string range =
        to - from == 1 ? formatted("%zu", from + 1) : formatted("%zu,%zu", from + 1, to - from);
    diff += "@@ -" + range + " +" + range + " @@\n";
    for (std::size_t i = from; i < to;) {
      if (old_lines[i] == new_lines[i]) {
        write(' ', old_lines[i++]);
        continue;
      }
      const std::size_t begin = i;
      while (i < to && old_lines[i] != new_lines[i]) write('-', old_lines[i++]);
      for (std::size_t k = begin; k < i; ++k) write('+', new_lines[k]);
    }
    first = last + 1;
  }
  return diff;
}

CsvWriter planTable(const FeedPlan& plan) {
  CsvWriter csv(
      "block,line,operation,tool,length_mm,old_feed_mm_per_min,new_feed_mm_per_min,reached_mm_per_min,limit,"
      "old_time_s,new_time_s,chip_mm,peak_force_n,peak_torque_nm,power_w,stability_margin,old_speed_rpm,"
      "new_speed_rpm",
      7);
  for (const PlannedBlock& b : plan.blocks)
    csv.row(b.block + 1, b.line, b.operation, b.tool, b.length / MM, b.old_feed / MM_PER_MIN,
            b.new_feed / MM_PER_MIN, b.reached / MM_PER_MIN, nameOf(b.limit), b.old_time, b.new_time,
            b.chip / MM, b.peak_force, b.peak_torque, b.power, b.margin, units::rpmFromRadPerSec(b.old_speed),
            units::rpmFromRadPerSec(b.new_speed));
  return csv;
}

std::string speedSummary(const std::vector<PlannedSpeed>& speeds) {
  std::string text;
  for (const PlannedSpeed& planned : speeds) {
    const double old_rpm = units::rpmFromRadPerSec(planned.old_speed);
    if (planned.new_speed) {
      text +=
          formatted("speed of line %d (T%d): %.0f rpm before, %.0f rpm after, probability of chatter %.3g\n",
                    planned.line, planned.tool, old_rpm, units::rpmFromRadPerSec(*planned.new_speed),
                    *planned.probability);
    } else {
      text += formatted("speed of line %d (T%d): %.0f rpm stays, %s\n", planned.line, planned.tool, old_rpm,
                        planned.reason.c_str());
    }
  }
  return text;
}

std::string planSummary(const FeedPlan& plan, const FeedLimits& limits) {
  std::string text =
      formatted("plan: the feed of %zu of %zu lines with a feed motion changes\n", plan.changed, plan.lines);
  text += timeLine("at constant feeds", plan.old_steady_time, plan.new_steady_time);
  if (std::isfinite(limits.acceleration))
    text += timeLine("with a stop after each motion", plan.old_time, plan.new_time);
  if (!plan.blocks.empty()) text += shares(plan);
  const auto unreached = std::count_if(plan.blocks.begin(), plan.blocks.end(), [](const PlannedBlock& block) {
    return block.reached < block.new_feed * (1.0 - 1e-9);
  });
  if (unreached > 0)
    text += formatted("%zd blocks are too short to reach their feed from rest to rest\n",
                      static_cast<std::ptrdiff_t>(unreached));
  text += blocksBelow(plan, &PlannedBlock::chip, limits.least_chip, MM, "chip thickness", " mm");
  text += blocksBelow(plan, &PlannedBlock::margin, 1.0, 1.0, "stability margin", "");
  return text;
}

}  // namespace smartmill::program
