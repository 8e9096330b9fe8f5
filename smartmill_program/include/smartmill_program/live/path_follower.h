#pragma once

#include <array>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/signal/streams.h"
#include "smartmill_program/live/condition_names.h"
#include "smartmill_program/live/follower_parameters.h"
#include "smartmill_program/live/live_program.h"

namespace smartmill::program {

/// Follows the tool along the path of a running program by the controller's states, and states the cutting
/// condition of every steady stretch that it passes, and between them whether the tool is in the work.
///
/// Each state leaves the places of the path that the tool can have reached; they are hypotheses that the
/// following states reject until one remains. A place is known after a restart in the middle of the program,
/// without knowledge of the block. A program that starts before its first cut machines a new part; one that
/// starts elsewhere continues the present one.
class PathFollower {
 public:
  enum class Follows {
    idle,       ///< no program runs
    searching,  ///< the tool has not come to the path
    ambiguous,  ///< it may be at several places
    following,
    lost  ///< it left the path in a feed motion
  };
  struct Status {
    Follows follows = Follows::idle;
    double place = NOT_A_NUMBER;           ///< [m] on the path
    int line = 0;                          ///< of the program
    int parts = 0;                         ///< begun since the start
    double deviation = NOT_A_NUMBER;       ///< [m] of the tool from the path
    double largest_deviation = 0.0;        ///< [m] while following
    double angle_std = NOT_A_NUMBER;       ///< [rad] of entry or exit by the position, in a steady cut
    bool cut_before = false;               ///< here the part was cut before a restart
    bool material_unknown = false;         ///< cuts before this place were skipped
    std::size_t lost = 0, conditions = 0;  ///< losses of the path, conditions stated since the start
  };

  /// @param zero [m] machine position at which the tip of the tool is at the program's zero
  PathFollower(std::shared_ptr<const LiveProgram> program, const std::array<double, 3>& zero,
               const ConditionNames& names, const FollowerParameters& parameters);

  /// @return the condition that begins; kind none when the present one ends out of the work
  std::optional<CuttingCondition> handle(const CncState& state);
  /// While another node states the condition, none begins here, and the present one is theirs to end.
  void setOtherSource(bool other);
  /// Whether a condition of this follower is valid.
  bool states() const { return active_.has_value() || unsteady_; }
  const Status& status() const { return status_; }

 private:
  using Point = nc::PathSegment::Point;
  struct Hypothesis {
    double place;        // [m]
    double reached;      // [m] furthest place; the tool does not go back
    double first_place;  // [m] at which it arose
    double chi_square;   // of the deviations
    double deviation;    // [m]
    std::size_t move;
  };
  struct Reading {
    double stamp, feed, speed;  // [s], [m/s], [rad/s]
  };
  struct Active {
    std::size_t stretch;
    double feed, speed;  // [m/s], [rad/s]
  };

  bool runs(const CncState& state) const;
  std::optional<Point> tipOf(const CncState& state) const;
  void track(const CncState& state, const Point& tip);
  void addCutTime(double from, const Hypothesis& at, double time);
  void restart();
  void advance(const Point& tip, double most);
  void search(const Point& tip);
  void keepInBlock(int sequence);
  void keepProbable();
  void loseIfInFeed();
  void arrive(const Hypothesis& at);
  const Hypothesis* unique() const { return hypotheses_.size() == 1 ? &hypotheses_.front() : nullptr; }
  /// The stretch at the present place in which a condition may be stated.
  std::optional<std::size_t> stretchHere(const CncState& state);
  double angleStd(const SteadyStretch& stretch, double deviation) const;
  bool isSteady() const;
  CuttingCondition begin(std::size_t index, double stamp);
  /// Outside of a steady stretch. @return the condition, if it is another than before
  std::optional<CuttingCondition> between(const CncState& state);
  bool isInWork(const CncState& state) const;
  CuttingCondition unsteady(const CncState& state);
  /// The fields of the tool, of a condition that begins at a move.
  CuttingCondition conditionOf(const Move& move, double stamp);
  std::string nameOf(const char* kind, const Move& move, int part, int count) const;

  std::shared_ptr<const LiveProgram> program_;
  std::array<double, 3> zero_;
  ConditionNames names_;
  FollowerParameters parameters_;
  double slack_;  // [m] of a place along the path
  bool several_tools_ = false;

  std::vector<Hypothesis> hypotheses_;
  Point last_tip_{};
  double last_stamp_ = 0.0, last_feed_ = 0.0;  // [s], [m/s]
  bool followed_ = false;                      // at the last state
  bool stopped_ = true;                        // since the place was last known
  double furthest_ = -1.0;                     // [m] place that the present part has reached; < 0: none
  double cut_until_ = 0.0;                     // [m] place until which it was cut before a restart
  std::size_t move_ = 0;                       // of the last known place
  std::deque<Reading> readings_;               // in the present stretch
  std::optional<std::size_t> stretch_;
  std::optional<Active> active_;
  bool unsteady_ = false;  // stated
  bool other_source_ = false;
  std::map<std::size_t, int> stated_;   // conditions by stretch
  std::map<int, int> stated_unsteady_;  // by line
  std::map<int, double> cut_time_;      // [s] in the work, by T
  Status status_;
};

}  // namespace smartmill::program
