#include "smartmill_loadmeter/inspection/cut_history.h"

#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"

namespace smartmill::loadmeter {

namespace {

constexpr std::size_t MOST_CUTS = 10000;  // newest cuts that are kept: weeks of production
constexpr std::size_t NAMED = 3;          // newest cuts in a message

// Growth of spindle and tool is along z, that of the feed screws along x and y.
std::array<TemperatureReading, 3> temperaturesOf(const TemperatureWatch& watch, double from, double to) {
  return {watch.axis(0, from, to), watch.axis(1, from, to), watch.spindle(from, to)};
}

}  // namespace

void CutHistory::handle(const CuttingCondition& condition, const TemperatureWatch& temperature,
                        const ProductionRun& production) {
  // A latched condition is received again when a subscriber reconnects.
  if (!cuts_.empty() && cuts_.back().condition.stamp == condition.stamp &&
      cuts_.back().condition.name == condition.name)
    return;
  if (!cuts_.empty() && std::isinf(cuts_.back().end)) {
    InspectedCut& last = cuts_.back();
    last.end = condition.stamp;
    last.temperature = temperaturesOf(temperature, last.condition.stamp, last.end);
    last.edge_age = production.edgeAge(last.condition.tool_name);
  }
  if (condition.kind != CuttingCondition::Kind::cut) return;
  InspectedCut cut;
  cut.condition = condition;
  cut.temperature = temperaturesOf(temperature, condition.stamp, condition.stamp);
  cuts_.push_back(cut);
  if (cuts_.size() > MOST_CUTS) cuts_.pop_front();
}

const InspectedCut& CutHistory::find(const std::string& name, double time) const {
  const InspectedCut *found = nullptr, *last = nullptr;
  std::size_t count = 0;
  std::string known;
  for (std::size_t i = cuts_.size(); i-- > 0;) {
    const InspectedCut& cut = cuts_[i];
    if (cuts_.size() - i <= NAMED) known += (known.empty() ? "" : ", ") + cut.condition.name;
    if (cut.condition.name != name) continue;
    ++count;
    if (!last) last = &cut;
    if (!found && (std::isnan(time) || (time >= cut.condition.stamp && time <= cut.end))) found = &cut;
  }
  if (!last)
    throw Error("no cut of this name since the start; newest cuts: " + (known.empty() ? "none" : known));
  if (!found)
    throw Error(formatted("cut_stamp %.3f s is in no cut of this name, the last one is from %.3f to %.3f s",
                          time, last->condition.stamp, last->end));
  if (std::isnan(time) && count > 1)
    throw Error(formatted("%zu cuts have this name, expected cut_stamp, the time of the cut", count));
  return *found;
}

}  // namespace smartmill::loadmeter
