#include "smartmill_program/plan/feed_planner.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "feed_words.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

constexpr double ROUNDING = 1e-9;   // [1] of computed values
constexpr double SAME_FEED = 1e-6;  // [1] an F word has twelve digits at most
constexpr double LEAST_GAIN =
    1e-3;  // [1] a feed changes by more, and is lowered by this when it does not hold

bool isFeed(const Move& move) {
  return !move.rapid && move.feed > 0.0 && move.path.length() > 0.0;
}

/// From rest to rest with a trapezoidal speed.
struct RestToRest {
  double reached, time;  // [m/s], [s]

  RestToRest(double length, double feed, double acceleration)
      : reached(std::min(feed, std::sqrt(acceleration * length))),
        time(length / reached + reached / acceleration) {}
};

double timeOf(const Move& move, double rapid, double acceleration, const FeedBound& bound) {
  if (move.path.length() == 0.0) return move.dwell;
  const double feed = move.rapid ? rapid : std::min(move.feed, bound.feed);
  return move.dwell + (feed > 0.0 ? RestToRest(move.path.length(), feed, acceleration).time : 0.0);
}

bool exceeds(double value, double limit) {
  return value > limit * (1.0 + ROUNDING);
}

/// The first limit that a step exceeds; none: it holds all.
FeedLimit exceeded(const StepPrediction& prediction, const FeedLimits& limits) {
  if (exceeds(prediction.force.peak_force, limits.force)) return FeedLimit::force;
  if (exceeds(prediction.force.peak_torque, limits.torque)) return FeedLimit::torque;
  if (exceeds(prediction.power, limits.power)) return FeedLimit::power;
  return FeedLimit::none;
}

}  // namespace

FeedPlanner::FeedPlanner(const std::string& name, const std::string& text, const ReaderOptions& reader,
                         ToolModels& models, const FeedLimits& limits,
                         const std::map<int, double>& speed_ratios)
    : name_(name),
      text_(text),
      reader_(reader),
      models_(models),
      limits_(limits),
      speed_ratios_(speed_ratios),
      bounds_(models, limits_, speed_ratios_) {
  limits.validate();
}

void FeedPlanner::fail(int line, const std::string& message) const {
  throw Error(name_ + ": line " + std::to_string(line) + ": " + message);
}

void FeedPlanner::add(const Step& step) {
  const Move& move = *step.move;
  if (!isFeed(move)) return;
  const FeedBound bound = bounds_.of(step);
  lines_[move.line].bound.lower(bound.feed / move.feed_word.unit, bound.limit);
}

void FeedPlanner::addMoves(const std::vector<Move>& moves) {
  for (const Move& move : moves) {
    if (!isFeed(move)) continue;
    LineFeed& line = lines_[move.line];
    const FeedWord& word = move.feed_word;
    if (line.seen && line.mode != word.mode)
      fail(move.line, move.operation + " is executed in two of G93, G94 and G95, expected one of them");
    line.seen = true;
    line.mode = word.mode;
    const FeedBound bound = bounds_.of(move);
    line.bound.lower(bound.feed / word.unit, bound.limit);
    // The tool drills by pecks: what is air in one step is the hole of the previous one.
    if (move.operation.size() > 2)
      line.bound.lower(bounds_.originalFeed(move) / word.unit, FeedLimit::no_model);
    line.old_low = std::min(line.old_low, word.value);
    line.old_high = std::max(line.old_high, word.value);
  }
}

void FeedPlanner::choose(int line, LineFeed& feed) const {
  const double most = feed.bound.feed;
  const bool one = feed.old_low == feed.old_high;
  if (one && feed.old_low <= most * (1.0 + ROUNDING) && most < feed.old_low * (1.0 + LEAST_GAIN)) {
    feed.number = feedNumberOf(feed.old_low);
    feed.value = feed.old_low;
    return;
  }
  feed.number = feed.bound.limit == FeedLimit::no_model ? feedNumberOf(most) : feedNumberUpTo(most);
  feed.value = std::stod(feed.number);
  if (feed.value == 0.0)
    fail(line, std::string("no feed above 0 holds the limit of the ") + nameOf(feed.bound.limit));
}

std::string FeedPlanner::rewritten() const {
  ProgramWords text(text_);
  for (const auto& [line, feed] : lines_) {
    const bool has = text.has(line, 'F');
    const bool same = has && !feed.stated && feed.old_low == feed.value && feed.old_high == feed.value;
    if ((!has && !feed.stated) || same) continue;
    try {
      text.set(line, 'F', feed.number);
    } catch (const Error& error) {
      throw Error(name_ + ": " + error.what());
    }
  }
  return text.text();
}

// The F word is modal: a line whose feed differs from the one in force gets an F word of its own. Then every
// line that inherited from the one before may need one, so that the text is read until no line does.
std::vector<Move> FeedPlanner::completed(std::string* text) {
  for (;;) {
    *text = rewritten();
    std::vector<Move> moves = interpretProgram(*text, name_, reader_);
    bool complete = true;
    const Move* last = nullptr;  // that states an F word which the text does not yet have
    std::set<int> added;
    for (const Move& move : moves) {
      if (!isFeed(move)) continue;
      LineFeed& line = lines_.at(move.line);
      const bool inherits = last && move.feed_word.block <= last->block;
      const double in_force = inherits ? lines_.at(last->line).value : move.feed_word.value;
      if (std::abs(in_force / line.value - 1.0) > SAME_FEED) {
        line.stated = true;
        added.insert(move.line);
        complete = false;
      }
      if (added.count(move.line) != 0) last = &move;
    }
    if (complete) return moves;
  }
}

FeedPlan FeedPlanner::plan(const AnalysedProgram& program, const AnalysedProgram& original,
                           const Stock& stock, const AnalysisOptions& options,
                           const ProgramAnalysis::Progress& progress) {
  addMoves(program.moves);
  for (auto& [line, feed] : lines_) choose(line, feed);
  AnalysisOptions without_stability = options;
  without_stability.stability = false;

  FeedPlan plan;
  std::vector<Move> planned;
  AnalysisResult after;
  for (bool holds = false; !holds && !plan.interrupted;) {
    planned = completed(&plan.text);
    std::map<int, FeedLimit> failed;
    const auto check = [&](const Step& step, const StepPrediction& prediction) {
      const Move& move = *step.move;
      if (move.rapid || step.contact.empty()) return;
      const FeedLimit limit = exceeded(prediction, limits_);
      if (limit != FeedLimit::none) failed.emplace(move.line, limit);
    };
    Stock copy = stock;
    after = ProgramAnalysis(name_, models_, copy, without_stability).run(planned, check, progress);
    plan.interrupted = after.interrupted;
    // Forces of contacts that differ by less than the resolution of the contact are those of the first one.
    for (const auto& [line, limit] : failed) {
      LineFeed& feed = lines_.at(line);
      feed.bound.lower(feed.value * (1.0 - LEAST_GAIN), limit);
      choose(line, feed);
    }
    holds = failed.empty();
  }
  if (!plan.interrupted) describe(program, original, {planned, after}, options.simulation.rapid, plan);
  return plan;
}

void FeedPlanner::describe(const AnalysedProgram& program, const AnalysedProgram& original,
                           const AnalysedProgram& planned, double rapid, FeedPlan& plan) const {
  plan.old_steady_time = original.analysis.time;
  plan.new_steady_time = planned.analysis.time;
  plan.lines = lines_.size();
  for (const auto& [line, feed] : lines_)
    plan.changed += feed.value != feed.old_low || feed.value != feed.old_high;
  std::map<std::size_t, const BlockSummary*> old_blocks, new_blocks;
  for (const BlockSummary& block : program.analysis.blocks) old_blocks[block.block] = &block;
  for (const BlockSummary& block : planned.analysis.blocks) new_blocks[block.block] = &block;
  for (std::size_t i = 0; i < original.moves.size(); ++i) {
    const Move &from = original.moves[i], &to = planned.moves[i];
    const FeedBound bound = bounds_.of(from);  // the control slows down on arcs by itself
    const double acceleration = limits_.acceleration;
    const double old_time = timeOf(from, rapid, acceleration, bound),
                 new_time = timeOf(to, rapid, acceleration, bound);
    plan.old_time += old_time;
    plan.new_time += new_time;
    if (!isFeed(from)) continue;
    if (plan.blocks.empty() || plan.blocks.back().block != from.block) {
      PlannedBlock block;
      block.block = from.block;
      block.line = from.line;
      block.tool = from.tool;
      block.operation = from.operation;
      block.old_feed = from.feed;
      block.new_feed = to.feed;
      block.old_speed = from.spindle_speed;
      block.new_speed = to.spindle_speed;
      block.limit = lines_.at(from.line).bound.limit;
      const BlockSummary& summary = *new_blocks.at(from.block);
      block.chip = summary.chip;
      block.peak_force = summary.peak_force;
      block.peak_torque = summary.peak_torque;
      block.power = summary.power;
      block.margin = old_blocks.at(from.block)->margin;
      plan.blocks.push_back(block);
    }
    PlannedBlock& block = plan.blocks.back();
    block.length += from.path.length();
    block.old_time += old_time;
    block.new_time += new_time;
    block.reached = std::max(block.reached, RestToRest(to.path.length(), to.feed, acceleration).reached);
  }
  for (PlannedBlock& block : plan.blocks)
    if (block.reached < block.new_feed * (1.0 - ROUNDING)) block.limit = FeedLimit::acceleration;
}

}  // namespace smartmill::program
