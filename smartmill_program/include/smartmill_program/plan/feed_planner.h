#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "smartmill_program/nc/program_reader.h"
#include "smartmill_program/plan/feed_limits.h"
#include "smartmill_program/plan/step_bounds.h"
#include "smartmill_program/program_analysis.h"

namespace smartmill::program {

/// An executed block with a feed motion.
struct PlannedBlock {
  static constexpr double NONE = BlockSummary::NONE;

  std::size_t block = 0;  ///< in the order of execution, from 0
  int line = 0, tool = 0;
  std::string operation;
  double length = 0.0;                      ///< [m] at feed
  double old_feed = 0.0, new_feed = 0.0;    ///< [m/s]
  double old_speed = 0.0, new_speed = 0.0;  ///< [rad/s]
  double reached = 0.0;                     ///< [m/s] highest speed between rest and rest, at the new feed
  double old_time = 0.0, new_time = 0.0;    ///< [s] from rest to rest, at feed
  FeedLimit limit = FeedLimit::none;        ///< that binds; acceleration also where the feed is not reached
  double chip = NONE;                       ///< [m] largest chip thickness at the new feed
  double peak_force = NONE, peak_torque = NONE, power = NONE;  ///< [N], [N m], [W] at the new feed
  double margin = NONE;  ///< [1] of stability at the new speed; independent of the feed
};

struct FeedPlan {
  std::string text;                       ///< the planned program
  std::vector<PlannedBlock> blocks;       ///< with feed motion, in the order of execution
  double old_time = 0.0, new_time = 0.0;  ///< [s] of the program, every motion from rest to rest
  /// [s] of the program at constant feed, as in ProgramAnalysis
  double old_steady_time = 0.0, new_steady_time = 0.0;
  std::size_t lines = 0, changed = 0;  ///< of the program with a feed motion; those whose feed changes
  bool interrupted = false;
};

/// A program with its analysis.
struct AnalysedProgram {
  const std::vector<Move>& moves;
  const AnalysisResult& analysis;
};

/// Feeds of a program that hold limits at every step. A line has one feed in all its executions, that of the
/// worst step. The planned program is analysed as it is written.
class FeedPlanner {
 public:
  /// @param text of the program, with its planned speeds @param name for messages
  /// @param speed_ratios [1] planned over original speed by the line of the S word
  /// @throws Error as FeedLimits::validate
  FeedPlanner(const std::string& name, const std::string& text, const ReaderOptions& reader,
              ToolModels& models, const FeedLimits& limits, const std::map<int, double>& speed_ratios = {});

  FeedPlanner(const FeedPlanner&) = delete;  // StepBounds refers to members
  FeedPlanner& operator=(const FeedPlanner&) = delete;

  const FeedLimits& limits() const { return limits_; }

  /// Takes a step of the analysis of the program. @throws Error as StepBounds
  void add(const Step& step);

  /// @param program all of whose steps have been added @param original with its own speeds
  /// @param stock before the program
  /// @throws Error "NAME: line N: ..." when no feed holds a limit
  FeedPlan plan(const AnalysedProgram& program, const AnalysedProgram& original, const Stock& stock,
                const AnalysisOptions& options, const ProgramAnalysis::Progress& progress = {});

 private:
  struct LineFeed {
    FeedBound bound;  // in units of the F word
    double old_low = FeedLimits::UNLIMITED, old_high = 0.0;
    bool seen = false;
    FeedMode mode = FeedMode::per_minute;
    bool stated = false;  // gets an F word of its own
    std::string number;   // of the F word
    double value = 0.0;
  };

  void addMoves(const std::vector<Move>& moves);
  void choose(int line, LineFeed& feed) const;
  std::string rewritten() const;
  std::vector<Move> completed(std::string* text);
  /// Times and blocks of a plan. @param rapid [m/s]
  void describe(const AnalysedProgram& program, const AnalysedProgram& original,
                const AnalysedProgram& planned, double rapid, FeedPlan& plan) const;
  [[noreturn]] void fail(int line, const std::string& message) const;

  std::string name_, text_;
  ReaderOptions reader_;
  ToolModels& models_;
  FeedLimits limits_;
  std::map<int, double> speed_ratios_;
  StepBounds bounds_;
  std::map<int, LineFeed> lines_;
};

}  // namespace smartmill::program
