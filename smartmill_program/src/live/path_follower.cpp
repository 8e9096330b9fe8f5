#include "smartmill_program/live/path_follower.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/formatted.h"

namespace smartmill::program {
namespace {

/// [1] Longest way over displacement or over actual feed times time: corners, and stamps that are late.
constexpr double MOST_WAY = 2.0;
constexpr double IMPROBABLE = 25.0;       // difference of chi-square: five standard deviations
constexpr std::size_t MOST_PLACES = 200;  // of hypotheses; more do not distinguish places
constexpr double ENTIRE = std::numeric_limits<double>::infinity();

/// [m] @param feed [m/s] @param speed [rad/s] of the spindle; 0: no feed per tooth
double feedPerTooth(const ToolGeometry& tool, double feed, double speed) {
  const double passing = speed * tool.teeth;
  return passing > 0.0 ? feed * units::TWO_PI / passing : 0.0;
}

}  // namespace

PathFollower::PathFollower(std::shared_ptr<const LiveProgram> program, const std::array<double, 3>& zero,
                           const ConditionNames& names, const FollowerParameters& parameters)
    : program_(std::move(program)),
      zero_(zero),
      names_(names),
      parameters_(parameters),
      slack_(2.0 * parameters.path_tolerance) {
  checkBounds(parameters);
  std::set<int> tools;
  for (const Move& move : program_->path.moves()) tools.insert(move.tool);
  several_tools_ = tools.size() > 1;
}

std::optional<CuttingCondition> PathFollower::handle(const CncState& state) {
  if (state.stamp < last_stamp_) restart();
  const std::optional<Point> tip = runs(state) ? tipOf(state) : std::nullopt;
  if (!tip) {
    hypotheses_.clear();
    followed_ = false;
    stopped_ = true;
    status_.follows = Follows::idle;
    status_.deviation = status_.angle_std = NOT_A_NUMBER;
    last_stamp_ = state.stamp;
    return between(state);
  }
  track(state, *tip);
  last_tip_ = *tip;
  last_feed_ = state.feed;
  last_stamp_ = state.stamp;

  const std::optional<std::size_t> here = stretchHere(state);
  if (here != stretch_) readings_.clear();
  stretch_ = here;
  if (!here) return between(state);
  readings_.push_back({state.stamp, state.feed, state.spindle_speed});
  while (readings_.size() > 2 && readings_[1].stamp <= state.stamp - parameters_.steady_time)
    readings_.pop_front();
  if (active_ && active_->stretch == *here) {
    const bool cut = program_->stretches[*here].cut;
    if (std::abs(state.spindle_speed - active_->speed) <= parameters_.speed_tolerance * active_->speed &&
        (!cut || std::abs(state.feed - active_->feed) <= parameters_.feed_tolerance * active_->feed))
      return std::nullopt;
    readings_.erase(readings_.begin(), readings_.end() - 1);
    return between(state);
  }
  if (active_ || other_source_ || !isSteady()) return between(state);
  return begin(*here, state.stamp);
}

/// Time has jumped back: a recording begins again.
void PathFollower::restart() {
  hypotheses_.clear();
  readings_.clear();
  stretch_.reset();
  followed_ = false;
  stopped_ = true;
  furthest_ = -1.0;
  cut_until_ = 0.0;
  move_ = 0;
  cut_time_.clear();
  status_ = {};
}

void PathFollower::setOtherSource(bool other) {
  other_source_ = other;
  if (!other) return;
  active_.reset();
  unsteady_ = false;
}

bool PathFollower::runs(const CncState& state) const {
  return state.connected && (state.run == CncRun::start || state.run == CncRun::hold) &&
         (parameters_.number == 0 || state.program == parameters_.number);
}

std::optional<PathFollower::Point> PathFollower::tipOf(const CncState& state) const {
  Point tip{};
  for (std::size_t a = 0; a < 3; ++a) {
    const std::optional<std::size_t> axis = controllerAxis(state.axes, a);
    if (!axis || *axis >= state.position.size() || !std::isfinite(state.position[*axis])) return std::nullopt;
    tip[a] = state.position[*axis] - zero_[a];
  }
  return tip;
}

void PathFollower::track(const CncState& state, const Point& tip) {
  const double time = state.stamp - last_stamp_;
  if (!hypotheses_.empty() && time <= parameters_.longest_gap) {
    advance(tip, MOST_WAY * std::max(state.feed, last_feed_) * time);
    if (hypotheses_.empty()) loseIfInFeed();
  } else {
    hypotheses_.clear();
    readings_.clear();
  }
  if (hypotheses_.empty()) {
    followed_ = false;
    search(tip);
  }
  keepInBlock(state.sequence);
  const Hypothesis* at = unique();
  if (at && followed_) addCutTime(status_.place, *at, time);
  if (at && !followed_) arrive(*at);
  followed_ = at != nullptr;
  if (!hypotheses_.empty()) {
    status_.follows = at ? Follows::following : Follows::ambiguous;
  } else if (status_.follows != Follows::lost) {
    status_.follows = Follows::searching;
  }
  if (!at) return;
  furthest_ = std::max(furthest_, at->place);
  move_ = at->move;
  status_.place = at->place;
  status_.line = program_->path.moves()[at->move].line;
  status_.deviation = at->deviation;
  status_.largest_deviation = std::max(status_.largest_deviation, at->deviation);
}

/// Where the part was cut before there is no contact. @param from [m] place at the last state @param time [s]
/// since then
void PathFollower::addCutTime(double from, const Hypothesis& at, double time) {
  if (!(at.place > from)) return;
  const double contact = program_->contactBetween(std::max(from, cut_until_), at.place);
  cut_time_[program_->path.moves()[at.move].tool] += time * contact / (at.place - from);
}

/// The tool has moved at least its displacement along the path. @param most [m] way by its feed
void PathFollower::advance(const Point& tip, double most) {
  const double displacement = distanceBetween(tip, last_tip_), least = displacement - 2.0 * slack_;
  most = std::max(most, MOST_WAY * displacement) + slack_;
  std::vector<Hypothesis> next;
  for (const Hypothesis& from : hypotheses_) {
    for (const ProgramPath::Place& place :
         program_->path.near(tip, from.reached - slack_, from.place + most, parameters_.path_tolerance)) {
      if (place.distance - from.place < least) continue;
      const double deviation = place.deviation / parameters_.position_std;
      next.push_back({place.distance, std::max(from.reached, place.distance), from.first_place,
                      from.chi_square + deviation * deviation, place.deviation, place.move});
    }
  }
  hypotheses_ = std::move(next);
  keepProbable();
}

/// Of several hypotheses at one place the most probable, and none that is improbable.
void PathFollower::keepProbable() {
  std::sort(hypotheses_.begin(), hypotheses_.end(),
            [](const Hypothesis& a, const Hypothesis& b) { return a.chi_square < b.chi_square; });
  std::vector<Hypothesis> kept;
  for (const Hypothesis& one : hypotheses_) {
    if (one.chi_square > hypotheses_.front().chi_square + IMPROBABLE || kept.size() >= MOST_PLACES) break;
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Hypothesis& other) {
      return std::abs(other.place - one.place) <= slack_;
    });
    if (!known) kept.push_back(one);
  }
  hypotheses_ = std::move(kept);
}

/// The deviation of a tool that comes to the path from outside rejects no place.
void PathFollower::search(const Point& tip) {
  for (const ProgramPath::Place& place :
       program_->path.near(tip, 0.0, program_->path.length(), parameters_.path_tolerance))
    hypotheses_.push_back({place.distance, place.distance, place.distance, 0.0, place.deviation, place.move});
  keepProbable();
}

/// Of several places those in the block that the controller states, if the program has it there; a state
/// between two blocks may show either.
void PathFollower::keepInBlock(int sequence) {
  if (hypotheses_.size() < 2 || sequence == 0) return;
  std::vector<Hypothesis> in_block;
  for (const Hypothesis& one : hypotheses_)
    if (program_->path.hasSequence(sequence, one.place - slack_, one.place + slack_)) in_block.push_back(one);
  if (!in_block.empty()) hypotheses_ = std::move(in_block);
}

/// A rapid move need not be straight, and the program may go to a position that it does not state.
void PathFollower::loseIfInFeed() {
  if (!followed_) return;
  const std::vector<Move>& moves = program_->path.moves();
  const auto leads = [&](double place) {
    const auto near = program_->path.near(last_tip_, place - slack_, place + slack_, ENTIRE);
    const std::size_t move = near.empty() ? moves.size() : near.front().move;
    if (move >= moves.size() || moves[move].rapid) return true;
    const bool ends = program_->path.begin(move + 1) - place <= slack_;
    return ends && (move + 1 == moves.size() || moves[move + 1].rapid ||
                    moves[move + 1].path.start() != moves[move].path.target());
  };
  if (leads(status_.place)) return;
  status_.follows = Follows::lost;
  ++status_.lost;
}

/// The place has become known: a new part, or the present one continued.
void PathFollower::arrive(const Hypothesis& at) {
  const double first_cut = program_->contact.empty() ? 0.0 : program_->contact.front().from;
  if (at.first_place <= first_cut && (furthest_ < 0.0 || furthest_ > first_cut)) {
    ++status_.parts;
    furthest_ = cut_until_ = 0.0;
    status_.material_unknown = false;
  } else if (furthest_ >= 0.0 && stopped_) {
    if (at.place < furthest_ - slack_) cut_until_ = furthest_;
    if (at.first_place > furthest_ + slack_ && program_->cutsBetween(furthest_, at.first_place))
      status_.material_unknown = true;
  }
  if (furthest_ < 0.0) ++status_.parts;
  stopped_ = false;
}

std::optional<std::size_t> PathFollower::stretchHere(const CncState& state) {
  status_.angle_std = NOT_A_NUMBER;
  status_.cut_before = false;
  const Hypothesis* at = unique();
  if (!at || state.run != CncRun::start) return std::nullopt;
  const std::vector<SteadyStretch>& stretches = program_->stretches;
  const auto next =
      std::upper_bound(stretches.begin(), stretches.end(), at->place + slack_,
                       [](double place, const SteadyStretch& stretch) { return place < stretch.begin; });
  if (next == stretches.begin()) return std::nullopt;
  const SteadyStretch& stretch = *(next - 1);
  const auto index = static_cast<std::size_t>(next - 1 - stretches.begin());
  if (!stretch.cut) {
    if (at->place > stretch.steady_to + slack_ || status_.material_unknown) return std::nullopt;
    return index;
  }
  status_.cut_before = stretch.begin < cut_until_;
  if (at->place < stretch.begin || at->place > stretch.steady_to || !(state.feed > 0.0) ||
      status_.cut_before || status_.material_unknown)
    return std::nullopt;
  status_.angle_std = angleStd(stretch, at->deviation);
  return index;
}

/// Of an angle whose wall is fixed in the part, when the tool is off its path: cos(angle) changes by the
/// deviation over the radius. The ends 0 and pi are the tool's own.
double PathFollower::angleStd(const SteadyStretch& stretch, double deviation) const {
  constexpr double OWN_END = 1e-3;  // [rad]
  const double shift =
      std::hypot(parameters_.position_std, deviation) / program_->tools.at(stretch.tool).radius();
  double largest = 0.0;
  for (const double angle : {stretch.engagement.entry, stretch.engagement.exit}) {
    if (angle < OWN_END || angle > units::PI - OWN_END) continue;
    for (const double sign : {-1.0, 1.0})
      largest = std::max(largest,
                         std::abs(std::acos(std::clamp(std::cos(angle) + sign * shift, -1.0, 1.0)) - angle));
  }
  return largest;
}

bool PathFollower::isSteady() const {
  constexpr double ROUNDING = 1e-6;  // [s] of stamps
  if (readings_.back().stamp - readings_.front().stamp < parameters_.steady_time - ROUNDING) return false;
  const auto steady = [&](double Reading::*value, double tolerance) {
    const auto [low, high] =
        std::minmax_element(readings_.begin(), readings_.end(),
                            [value](const Reading& a, const Reading& b) { return a.*value < b.*value; });
    return (*low).*value > 0.0 && (*high).*value - (*low).*value <= tolerance * (*high).*value;
  };
  const bool cut = program_->stretches[*stretch_].cut;
  return steady(&Reading::speed, parameters_.speed_tolerance) &&
         (!cut || steady(&Reading::feed, parameters_.feed_tolerance));
}

CuttingCondition PathFollower::begin(std::size_t index, double stamp) {
  const SteadyStretch& stretch = program_->stretches[index];
  Active active{index, 0.0, 0.0};
  for (const Reading& reading : readings_) {
    active.feed += reading.feed / static_cast<double>(readings_.size());
    active.speed += reading.speed / static_cast<double>(readings_.size());
  }
  active_ = active;
  unsteady_ = false;
  ++status_.conditions;

  const Move& move = program_->path.moves()[stretch.move];
  CuttingCondition condition = conditionOf(move, stamp);
  condition.kind = stretch.cut ? CuttingCondition::Kind::cut : CuttingCondition::Kind::air;
  condition.name = nameOf(stretch.cut ? "" : " air from", move, stretch.part, ++stated_[index]);
  condition.spindle_speed = active.speed;
  if (!stretch.cut) return condition;
  condition.engagement = stretch.engagement;
  condition.engagement.feed_per_tooth = feedPerTooth(condition.tool, active.feed, active.speed);
  for (std::size_t a = 0; a < 3; ++a) {
    condition.steady_from[a] = stretch.from[a] + zero_[a];
    condition.steady_to[a] = stretch.turns ? NOT_A_NUMBER : stretch.to[a] + zero_[a];
  }
  return condition;
}

CuttingCondition PathFollower::conditionOf(const Move& move, double stamp) {
  CuttingCondition condition;
  condition.stamp = stamp;
  condition.material = names_.material;
  condition.tool_name = toolName(names_.tool, move.tool, several_tools_);
  if (const auto tool = program_->tools.find(move.tool); tool != program_->tools.end())
    condition.tool = tool->second;
  condition.cut_time_before = cut_time_[move.tool];
  return condition;
}

std::string PathFollower::nameOf(const char* kind, const Move& move, int part, int count) const {
  return std::filesystem::path(program_->name).filename().string() + kind + formatted(" line %d", move.line) +
         (part > 1 ? formatted(" stretch %d", part) : "") + (count > 1 ? formatted(" (%d)", count) : "");
}

std::optional<CuttingCondition> PathFollower::between(const CncState& state) {
  const bool in_work = !other_source_ && isInWork(state);
  if (!active_ && in_work == unsteady_) return std::nullopt;
  active_.reset();
  unsteady_ = in_work;
  if (in_work) return unsteady(state);
  CuttingCondition none;
  none.stamp = state.stamp;
  return none;
}

/// Where the place is not known, at any of the possible ones, and until the next states.
bool PathFollower::isInWork(const CncState& state) const {
  constexpr double AHEAD = 0.15;         // [s] air ends 0.1 s before the contact
  constexpr double MOST_OVERRIDE = 2.0;  // a state just after a rapid move has its feed
  if (status_.follows == Follows::idle || status_.follows == Follows::searching) return false;
  if (status_.follows == Follows::lost || status_.material_unknown) return true;
  return std::any_of(hypotheses_.begin(), hypotheses_.end(), [&](const Hypothesis& at) {
    const Move& move = program_->path.moves()[at.move];
    const double ahead = move.rapid ? 0.0 : AHEAD * std::min(state.feed, MOST_OVERRIDE * move.feed);
    return program_->cutsBetween(at.place - slack_, at.place + slack_ + ahead);
  });
}

CuttingCondition PathFollower::unsteady(const CncState& state) {
  const Move& move = program_->path.moves()[move_];
  CuttingCondition condition = conditionOf(move, state.stamp);
  condition.kind = CuttingCondition::Kind::unsteady;
  condition.name = nameOf(" unsteady from", move, 1, ++stated_unsteady_[move.line]);
  condition.spindle_speed = state.spindle_speed;
  condition.steady_from = condition.steady_to = {NOT_A_NUMBER, NOT_A_NUMBER, NOT_A_NUMBER};
  const Hypothesis* at = unique();
  if (!at) return condition;
  const auto next = std::find_if(program_->stretches.begin(), program_->stretches.end(),
                                 [at](const SteadyStretch& stretch) { return stretch.begin > at->place; });
  const double end = next == program_->stretches.end() ? program_->path.length() : next->steady_from;
  if (const auto engagement = program_->enclosingEngagement(at->place, end)) {
    condition.engagement = *engagement;
    condition.engagement.feed_per_tooth = feedPerTooth(condition.tool, state.feed, state.spindle_speed);
  }
  return condition;
}

}  // namespace smartmill::program
