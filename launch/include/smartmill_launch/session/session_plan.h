#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_launch/session/cut_planner.h"

namespace smartmill::session {

/// What the job is made of.
struct PlanParameters : PathParameters {
  std::vector<double> air_speeds{314.2, 628.3, 942.5, 1256.6};
  double air_time = 1.5;
  std::vector<double> air_feeds;
  double air_move_time = 1.2, air_way = 8.0e-3;

  double slot_speed = 418.9;
  double slot_depth = 1.0e-3;
  std::vector<double> slot_feeds{5.0e-5, 1.0e-4, 1.5e-4, 2.0e-4};
  double slot_time = 2.0, least_slot_time = 0.8;

  double stable_time = 1.0, unstable_time = 0.5;
  double least_revolutions = 50.0;

  double resonance_speed = 1460.84;
  double resonance_depth = 1.0e-3;
  double resonance_feed = 1.0e-4;
  double resonance_time = 0.8;

  void declare(ParameterTable& table);
  /// @throws Error naming key and value.
  void validate() const;
};

/// A point of a stability chart that may be cut.
struct Point {
  double spindle_speed = 0.0;               ///< [rad/s]
  double axial_depth = 0.0;                 ///< [m]
  double depth_limit = 0.0;                 ///< [m] +inf: none
  double chatter_frequency = NOT_A_NUMBER;  ///< [Hz] at the limit
};

/// The paths of the whole job in the stock of the believed model: each cut in a lane of its own along +x,
/// full slots, lanes side by side in y. All positions are of the tool tip's centre in the machine frame.
class SessionPlan {
 public:
  /// @throws Error of one line when the model lacks something or the job does not fit machine or stock.
  SessionPlan(const MachineModel& model, const PlanParameters& parameters);

  const std::string& material() const { return planner_.material(); }
  const std::vector<PlannedCut>& airCuts() const { return air_cuts_; }
  /// Moves in air along +x at the feeds that were asked for; none as shipped.
  const std::vector<PlannedCut>& airMoves() const { return air_moves_; }
  const std::vector<PlannedCut>& slots() const { return slots_; }
  const std::optional<PlannedCut>& resonance() const { return resonance_; }

  /// The verifying cuts have lanes of their own. @throws Error saying what does not fit.
  PlannedCut stable(const Point& point, double feed_per_tooth) const;
  PlannedCut unstable(const Point& point, double feed_per_tooth) const;

  /// First of the points that stable() or unstable() would take. @param why reasons of those refused, one
  /// line.
  std::optional<Point> firstStable(const std::vector<Point>& points, double feed_per_tooth,
                                   std::string& why) const;
  std::optional<Point> firstUnstable(const std::vector<Point>& points, double feed_per_tooth,
                                     std::string& why) const;

  const CutPlanner& planner() const { return planner_; }

 private:
  PlanParameters parameters_;
  CutPlanner planner_;
  std::vector<PlannedCut> air_cuts_, air_moves_, slots_;
  std::optional<PlannedCut> resonance_;
};

/// A verdict of the chatter detector on one window of a cut.
struct ChatterWindow {
  bool chatter = false;
  double frequency = NOT_A_NUMBER;  ///< [Hz]
  double severity = 0.0;            ///< [N]
};

/// What the windows of one cut say together.
struct CutVerdict {
  enum class Kind { unknown, stable, undecided, chatter };
  Kind kind = Kind::unknown;
  std::size_t windows = 0, chattering = 0;
  double frequency = NOT_A_NUMBER;  ///< [Hz] median of the chattering windows
  double severity = 0.0;            ///< [N] largest
  std::string text() const;         ///< e.g. "chatter at 812.3 Hz (7 of 8 windows)"
};

/// stable, chatter, undecided or unknown.
const char* wordOf(CutVerdict::Kind kind);

/// Stable when at most a tenth of the windows chatters, chatter from half on: it takes time to grow, and one
/// window may hold a disturbance. Fewer than two windows say nothing.
CutVerdict judge(const std::vector<ChatterWindow>& windows);

}  // namespace smartmill::session
