#include "smartmill_launch/session/session_plan.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "session/number_text.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::session {
namespace {

constexpr std::size_t VERIFYING_CUTS = 2;
// Of the feed of the chart: the cut lasts longer in its lane, and the limit does not depend on it.
constexpr double CONTROL_FEED = 0.5;    // [1]
constexpr std::size_t FEWEST_CUTS = 3;  // for the coefficients, as slots
constexpr std::size_t FEWEST_PROBING_CUTS = 3;

const PlanParameters& checked(const PlanParameters& parameters) {
  parameters.validate();
  return parameters;
}

}  // namespace

SessionPlan::SessionPlan(const MachineModel& model, const PlanParameters& parameters)
    : parameters_(checked(parameters)), planner_(model, parameters) {
  const bool informative = parameters_.isInformative();
  const std::size_t tests = informative ? FEWEST_CUTS : parameters_.slot_feeds.size();
  if (!parameters_.hammer) countProbingCuts(tests);
  const std::size_t needed = tests + verifyingCuts();
  planner_.requireLanes(
      parameters_.lost_lanes + needed,
      std::to_string(tests) + " slot tests, " +
          (parameters_.hammer ? std::to_string(needed - tests) + " verifying cuts"
                              : std::to_string(probing_) + " probing cuts, the recommended cut") +
          (parameters_.lost_lanes > 0 ? ", " + std::to_string(parameters_.lost_lanes) + " cut before" : ""));
  for (double speed : parameters_.air_speeds) air_cuts_.push_back(planner_.air(speed, parameters_.air_time));
  for (double feed : parameters_.air_feeds)
    air_moves_.push_back(
        planner_.airMove(parameters_.slot_speed, feed, parameters_.air_move_time, parameters_.air_way));
  for (std::size_t i = 0; i < parameters_.slot_feeds.size(); ++i)
    slots_.push_back(planner_.slot(slotRequest(i)));
  if (informative) {
    addCandidates();
  } else {
    verifying_lane_ = parameters_.lost_lanes + slots_.size();
  }
  planResonance();
  planTuning();
}

// As many as there are lanes, so that the recommended cut has one.
void SessionPlan::countProbingCuts(std::size_t tests) {
  const auto most = static_cast<std::size_t>(parameters_.probing_cuts);
  const std::size_t others = parameters_.lost_lanes + tests + 1, lanes = planner_.lanes();
  const std::size_t free = lanes > others ? lanes - others : 0;
  probing_ = std::min(most, std::max(free, FEWEST_PROBING_CUTS));
}

std::size_t SessionPlan::verifyingCuts() const {
  if (!parameters_.hammer) return probing_ + 1;
  return tuningLane() + parameters_.tuning_speeds.size();
}

std::size_t SessionPlan::controlLane() const {
  return VERIFYING_CUTS + (parameters_.resonance_speed > 0.0 ? 1 : 0);
}

std::size_t SessionPlan::tuningLane() const {
  return controlLane() + (parameters_.control_time > 0.0 ? 1 : 0);
}

SlotRequest SessionPlan::slotRequest(std::size_t feed) const {
  SlotRequest request;
  request.name = "slot_" + std::to_string(feed + 1);
  request.lane = parameters_.lost_lanes + feed;
  request.speed = parameters_.slot_speed;
  request.depth = parameters_.slot_depth;
  request.feed_per_tooth = parameters_.slot_feeds[feed];
  request.time = parameters_.slot_time;
  request.least_time = parameters_.least_slot_time;
  return request;
}

void SessionPlan::addCandidates() {
  for (const Immersion immersion : {Immersion::slot, Immersion::half_up, Immersion::half_down}) {
    for (std::size_t i = 0; i < parameters_.slot_feeds.size(); ++i) {
      SlotRequest request = slotRequest(i);
      request.immersion = immersion;
      request.lane = 0;
      if (immersion != Immersion::slot) {
        request.name = wordOf(immersion) + ("_" + std::to_string(i + 1));
        request.depth =
            immersion == Immersion::half_up ? parameters_.half_up_depth : parameters_.half_down_depth;
      }
      requests_.push_back(request);
      candidates_.push_back(planner_.slot(request));
    }
  }
  placed_.assign(candidates_.size(), false);
}

// A slot of the resonance's depth and feed in one of the lanes of the verifying cuts.
SlotRequest SessionPlan::lightSlot(double speed, std::size_t lane) const {
  SlotRequest request;
  request.lane = verifying_lane_ + lane;
  request.speed = speed;
  request.depth = parameters_.resonance_depth;
  request.feed_per_tooth = parameters_.resonance_feed;
  request.least_time = parameters_.least_revolutions * units::TWO_PI / speed;
  request.shift = shift_;
  return request;
}

void SessionPlan::planResonance() {
  if (!parameters_.hammer || !(parameters_.resonance_speed > 0.0)) return;
  SlotRequest request = lightSlot(parameters_.resonance_speed, VERIFYING_CUTS);
  request.name = "resonance";
  request.time = parameters_.resonance_time;
  resonance_ = planner_.slot(request);
}

void SessionPlan::planTuning() {
  tuning_.clear();
  std::size_t lane = tuningLane();
  for (const double speed : parameters_.tuning_speeds) {
    SlotRequest request = lightSlot(speed, lane++);
    request.name = "tuning_" + numberText(units::rpmFromRadPerSec(speed), 0);
    request.time = parameters_.tuning_time;
    const PlannedCut air = planner_.air(speed, parameters_.air_time);
    tuning_.insert(tuning_.end(), {air, air, planner_.slot(request)});
  }
}

std::vector<std::size_t> SessionPlan::available() const {
  const bool first = std::find(placed_.begin(), placed_.end(), true) == placed_.end();
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < requests_.size(); ++i) {
    if (!placed_[i] && (first || requests_[i].immersion == Immersion::slot)) indices.push_back(i);
  }
  return indices;
}

double SessionPlan::stockOf(std::size_t candidate) const {
  return requests_.at(candidate).immersion == Immersion::slot ? planner_.laneWidth() : planner_.stripWidth();
}

double SessionPlan::freeStock() const {
  double width = planner_.width() - static_cast<double>(verifyingCuts()) * planner_.laneWidth();
  for (std::size_t i = 0; i < requests_.size(); ++i) width -= placed_[i] ? stockOf(i) : 0.0;
  return width;
}

std::vector<PlannedCut> SessionPlan::place(const std::vector<std::size_t>& chosen) {
  // Lanes: the verifying cuts, then the slots. Strips begin at the sides of the stock.
  std::map<Immersion, std::size_t> next{{Immersion::slot, verifyingCuts()}};
  double width = 0.0;
  for (std::size_t i = 0; i < requests_.size(); ++i) next[requests_[i].immersion] += placed_[i] ? 1 : 0;
  for (const std::size_t i : chosen) {
    requests_.at(i).lane = next[requests_[i].immersion]++;
    width += stockOf(i);
  }
  if (width > freeStock() * (1.0 + 1e-9)) {
    throw Error("test cuts: " + mm(width) + " of stock in y, " + mm(std::max(0.0, freeStock())) + " is free");
  }
  for (const std::size_t i : chosen) placed_[i] = true;
  shift_ = static_cast<double>(next[Immersion::half_up]) * planner_.stripWidth();
  // The side of a strip is free as far as the strip before it was cut, beyond the front of the tool.
  std::map<Immersion, double> free_until;
  std::vector<PlannedCut> cuts(chosen.size());
  for (std::size_t k = chosen.size(); k-- > 0;) {
    SlotRequest request = requests_[chosen[k]];
    if (request.immersion == Immersion::slot) {
      request.shift = shift_;
    } else if (free_until.count(request.immersion)) {
      request.least_end = free_until[request.immersion];
    }
    cuts[k] = planner_.slot(request);
    free_until[request.immersion] = cuts[k].to[0] + planner_.stripWidth();
  }
  planResonance();
  planTuning();
  return cuts;
}

PlannedCut SessionPlan::verifying(const char* name, std::size_t lane, const Point& point,
                                  double feed_per_tooth, double time) const {
  SlotRequest request;
  request.name = name;
  request.lane = verifying_lane_ + lane;
  request.speed = point.spindle_speed;
  request.depth = point.axial_depth;
  request.feed_per_tooth = feed_per_tooth;
  request.time = time;
  request.least_time = parameters_.least_revolutions * units::TWO_PI / point.spindle_speed;
  if (!parameters_.hammer) {
    // The speed is chosen by what the cuts have shown: machine and time follow it.
    request.feed_per_tooth = std::min(feed_per_tooth, planner_.feedPerTooth(point.spindle_speed));
    request.time = std::max(time, request.least_time);
  }
  request.shift = shift_;
  return planner_.slot(request);
}

PlannedCut SessionPlan::stable(const Point& point, double feed_per_tooth) const {
  return verifying("verify_stable", probing_, point, feed_per_tooth, parameters_.stable_time);
}

PlannedCut SessionPlan::probing(std::size_t index, const Point& point, double feed_per_tooth) const {
  const std::string name = "probe_" + std::to_string(index + 1);
  return verifying(name.c_str(), index, point, feed_per_tooth, parameters_.stable_time);
}

PlannedCut SessionPlan::unstable(const Point& point, double feed_per_tooth) const {
  return verifying("verify_unstable", 1, point, feed_per_tooth, parameters_.unstable_time);
}

std::optional<PlannedCut> SessionPlan::controlled(const Point& point, double feed_per_tooth) const {
  if (!(parameters_.control_time > 0.0)) return std::nullopt;
  return verifying("chatter_control", controlLane(), point, CONTROL_FEED * feed_per_tooth,
                   parameters_.control_time);
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
