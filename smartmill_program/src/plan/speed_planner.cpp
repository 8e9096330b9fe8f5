#include "smartmill_program/plan/speed_planner.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "feed_words.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

constexpr double STEP = 0.01;  // [1] between speeds, as wide as their margin

double rounded(double speed) {
  return units::radPerSecFromRpm(std::round(units::rpmFromRadPerSec(speed)));
}

}  // namespace

void SpeedLimits::validate() const {
  if (!(low > 0.0) || !(high >= low))
    throw Error(formatted("speeds of %g to %g rpm: expected 0 < low <= high", units::rpmFromRadPerSec(low),
                          units::rpmFromRadPerSec(high)));
}

SpeedPlanner::SpeedPlanner(ToolModels& models, const SpeedLimits& limits) : models_(models), limits_(limits) {
  limits.validate();
}

void SpeedPlanner::add(const Step& step) {
  const Move& move = *step.move;
  if (move.rapid || step.contact.empty() || move.speed_line == 0) return;
  Operation& operation = operations_[move.speed_line];
  if (operation.depth.empty()) {
    operation.tool = move.tool;
    operation.speed = move.spindle_speed;
  }
  operation.several =
      operation.several || operation.tool != move.tool || operation.speed != move.spindle_speed;
  double& depth = operation.depth[EngagementCell::of(step.contact, step.feed_angle, move.left_hand)];
  depth = std::max(depth, step.contact.axialDepth());
}

bool SpeedPlanner::choose(const Operation& operation, const std::function<bool(double)>& goes_on,
                          PlannedSpeed& planned) const {
  const MachineModel& model = models_.of(operation.tool);
  if (operation.several) {
    planned.reason = "it is executed with several tools or speeds";
    return true;
  }
  if (!hasModes(model)) {
    planned.reason = "the model of the tool states no modes";
    return true;
  }
  const double spindle = model.spindle ? model.spindle->max_speed.value_or(limits_.high) : limits_.high;
  const double high = std::min(limits_.high, spindle);
  // The deepest first: it is the most likely to chatter.
  std::vector<std::pair<EngagementCell, double>> cuts(operation.depth.begin(), operation.depth.end());
  std::stable_sort(cuts.begin(), cuts.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  ChatterRisk risk(model, limits_.risk);
  for (double at = high; at >= limits_.low * (1.0 - 0.5 * STEP); at /= 1.0 + STEP) {
    if (!goes_on((high - at) / (high - limits_.low + STEP))) return false;
    const double speed = rounded(std::max(at, limits_.low));
    const bool mean = std::all_of(cuts.begin(), cuts.end(), [&](const auto& cut) {
      return risk.meanIsStable(cut.first, speed, cut.second);
    });
    if (!mean) continue;
    std::optional<double> largest = 0.0;
    for (const auto& [cell, depth] : cuts) {
      const std::optional<double> probability = risk.probability(cell, speed, depth);
      largest = probability ? std::optional<double>(std::max(*largest, *probability)) : std::nullopt;
      if (!largest) break;
    }
    if (!largest) continue;
    planned.new_speed = speed;
    planned.probability = largest;
    return true;
  }
  planned.reason =
      formatted("no speed of %.0f to %.0f rpm chatters with a probability of %.3g or less",
                units::rpmFromRadPerSec(limits_.low), units::rpmFromRadPerSec(high), limits_.risk.risk);
  return true;
}

std::vector<PlannedSpeed> SpeedPlanner::plan(const std::function<bool(double share)>& progress) {
  std::vector<PlannedSpeed> speeds;
  const auto goes_on = [&](double share) {
    return !progress ||
           progress((static_cast<double>(speeds.size()) + share) / static_cast<double>(operations_.size()));
  };
  for (const auto& [line, operation] : operations_) {
    PlannedSpeed planned;
    planned.line = line;
    planned.tool = operation.tool;
    planned.old_speed = operation.speed;
    if (!choose(operation, goes_on, planned)) return {};
    speeds.push_back(std::move(planned));
  }
  return speeds;
}

SpeedText withSpeeds(const std::string& text, const std::vector<PlannedSpeed>& speeds) {
  SpeedText result;
  ProgramWords words(text);
  for (const PlannedSpeed& planned : speeds) {
    if (!planned.new_speed || !words.has(planned.line, 'S')) continue;
    words.set(planned.line, 'S', formatted("%.0f", units::rpmFromRadPerSec(*planned.new_speed)));
    result.ratios[planned.line] = *planned.new_speed / planned.old_speed;
  }
  result.text = words.text();
  return result;
}

}  // namespace smartmill::program
