#include "smartmill_launch/session/session_plan.h"

#include <algorithm>
#include <cmath>

#include "session/number_text.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::session {
namespace {

constexpr std::size_t VERIFYING_CUTS = 2;

const PlanParameters& checked(const PlanParameters& parameters) {
  parameters.validate();
  return parameters;
}

}  // namespace

SessionPlan::SessionPlan(const MachineModel& model, const PlanParameters& parameters)
    : parameters_(checked(parameters)), planner_(model, parameters) {
  const std::size_t slots = parameters_.slot_feeds.size();
  const bool with_resonance = parameters_.resonance_speed > 0.0;
  const std::size_t needed = slots + VERIFYING_CUTS + (with_resonance ? 1 : 0);
  planner_.requireLanes(
      needed, std::to_string(slots) + " slot tests, " + std::to_string(needed - slots) + " verifying cuts");
  for (double speed : parameters_.air_speeds) air_cuts_.push_back(planner_.air(speed, parameters_.air_time));
  for (double feed : parameters_.air_feeds)
    air_moves_.push_back(
        planner_.airMove(parameters_.slot_speed, feed, parameters_.air_move_time, parameters_.air_way));
  for (std::size_t i = 0; i < slots; ++i) {
    slots_.push_back(
        planner_.slot({"slot_" + std::to_string(i + 1), i, parameters_.slot_speed, parameters_.slot_depth,
                       parameters_.slot_feeds[i], parameters_.slot_time, parameters_.least_slot_time}));
  }
  if (with_resonance) {
    const double least = parameters_.least_revolutions * units::TWO_PI / parameters_.resonance_speed;
    resonance_ = planner_.slot({"resonance", slots + VERIFYING_CUTS, parameters_.resonance_speed,
                                parameters_.resonance_depth, parameters_.resonance_feed,
                                parameters_.resonance_time, least});
  }
}

PlannedCut SessionPlan::stable(const Point& point, double feed_per_tooth) const {
  return planner_.slot({"verify_stable", slots_.size(), point.spindle_speed, point.axial_depth,
                        feed_per_tooth, parameters_.stable_time,
                        parameters_.least_revolutions * units::TWO_PI / point.spindle_speed});
}

PlannedCut SessionPlan::unstable(const Point& point, double feed_per_tooth) const {
  return planner_.slot({"verify_unstable", slots_.size() + 1, point.spindle_speed, point.axial_depth,
                        feed_per_tooth, parameters_.unstable_time,
                        parameters_.least_revolutions * units::TWO_PI / point.spindle_speed});
}

std::optional<Point> SessionPlan::firstStable(const std::vector<Point>& points, double feed_per_tooth,
                                              std::string& reasons) const {
  for (const Point& point : points) {
    try {
      stable(point, feed_per_tooth);
      return point;
    } catch (const Error& error) {
      reasons += (reasons.empty() ? "" : "; ") + std::string(error.what());
    }
  }
  return std::nullopt;
}

std::optional<Point> SessionPlan::firstUnstable(const std::vector<Point>& points, double feed_per_tooth,
                                                std::string& reasons) const {
  for (const Point& point : points) {
    try {
      unstable(point, feed_per_tooth);
      return point;
    } catch (const Error& error) {
      reasons += (reasons.empty() ? "" : "; ") + std::string(error.what());
    }
  }
  return std::nullopt;
}

const char* wordOf(CutVerdict::Kind kind) {
  switch (kind) {
    case CutVerdict::Kind::stable:
      return "stable";
    case CutVerdict::Kind::chatter:
      return "chatter";
    case CutVerdict::Kind::undecided:
      return "undecided";
    case CutVerdict::Kind::unknown:
      break;
  }
  return "unknown";
}

std::string CutVerdict::text() const {
  const std::string share =
      " (" + std::to_string(chattering) + " of " + std::to_string(windows) + " windows chatter)";
  switch (kind) {
    case Kind::stable:
      return "stable" + share;
    case Kind::chatter:
      return "chatter at " + numberText(frequency) + " Hz, " + numberText(severity, 0) + " N rms" + share;
    case Kind::undecided:
      return "undecided" + share;
    case Kind::unknown:
      break;
  }
  return "no verdict: " + std::to_string(windows) + " windows of steady cutting, expected two or more";
}

CutVerdict cutVerdict(const std::vector<ChatterWindow>& windows) {
  CutVerdict verdict;
  verdict.windows = windows.size();
  std::vector<double> frequencies;
  for (const ChatterWindow& window : windows) {
    verdict.severity = std::max(verdict.severity, window.severity);
    if (!window.chatter) continue;
    ++verdict.chattering;
    if (std::isfinite(window.frequency)) frequencies.push_back(window.frequency);
  }
  if (!frequencies.empty()) {
    const auto middle = frequencies.begin() + static_cast<std::ptrdiff_t>(frequencies.size() / 2);
    std::nth_element(frequencies.begin(), middle, frequencies.end());
    verdict.frequency = *middle;
  }
  if (verdict.windows < 2) return verdict;
  verdict.kind = 10 * verdict.chattering <= verdict.windows  ? CutVerdict::Kind::stable
                 : 2 * verdict.chattering >= verdict.windows ? CutVerdict::Kind::chatter
                                                             : CutVerdict::Kind::undecided;
  return verdict;
}

}  // namespace smartmill::session
