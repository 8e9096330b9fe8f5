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

/// Parameters of the tests and cuts of a session.
struct PlanParameters : PathParameters {
  std::vector<double> air_speeds{314.2, 628.3, 942.5, 1256.6};
  double air_time = 1.5;
  std::vector<double> air_feeds;
  double air_move_time = 1.2, air_way = 8.0e-3;

  double slot_speed = 418.9;
  double slot_depth = 1.0e-3;
  std::vector<double> slot_feeds{5.0e-5, 1.0e-4, 1.5e-4, 2.0e-4};
  double slot_time = 2.0, least_slot_time = 0.8;
  std::string test_cuts = "slots";
  double half_up_depth = 2.0e-3, half_down_depth = 2.0e-3;  // the torque of a slot of half the depth
  double target_ktc_std = 4.0e6, target_kte_std = 300.0;    // 0.5 % and 1 % of aluminium

  double stable_time = 1.0, unstable_time = 0.5;
  double control_time = 0.0;
  bool hammer = true;
  int probing_cuts = 5;
  double least_revolutions = 50.0;

  double resonance_speed = 1460.84;
  double resonance_depth = 1.0e-3;
  double resonance_feed = 1.0e-4;
  double resonance_time = 0.8;

  std::vector<double> tuning_speeds;  // those of the calibration with sensor spindle, else none
  double tuning_time = 1.5;

  std::size_t lost_lanes = 0;  ///< lanes at the side of the first that are cut already; no parameter

  bool isInformative() const { return test_cuts == "informative"; }
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

/// Paths of all cuts of a session in the stock of the nominal model, by CutPlanner. With test_cuts
/// `informative` the cuts for the coefficients are candidates, which take their place in the stock once they
/// are chosen.
class SessionPlan {
 public:
  /// @throws Error of one line if the model is incomplete or a cut does not fit machine or stock.
  SessionPlan(const MachineModel& model, const PlanParameters& parameters);

  const std::string& material() const { return planner_.material(); }
  const std::vector<PlannedCut>& airCuts() const { return air_cuts_; }
  /// Moves in air along +x at the feeds of air_feeds; none by default.
  const std::vector<PlannedCut>& airMoves() const { return air_moves_; }
  const std::vector<PlannedCut>& slots() const { return slots_; }
  const std::optional<PlannedCut>& resonance() const { return resonance_; }
  /// Cuts from which the process noise of the force filter is tuned, two in air and a light slot at each
  /// speed of tuning_speeds.
  const std::vector<PlannedCut>& tuning() const { return tuning_; }

  /// Slots and cuts of half immersion, up and down, at each feed; without test_cuts `informative` none.
  const std::vector<PlannedCut>& candidates() const { return candidates_; }
  /// Indices of the candidates that may be placed next: all at first, then the slots that are left.
  std::vector<std::size_t> available() const;
  double stockOf(std::size_t candidate) const;  ///< [m] width
  double freeStock() const;                     ///< [m] width for further candidates
  /// Paths of chosen candidates, in their order. @throws Error if they do not fit the stock.
  std::vector<PlannedCut> place(const std::vector<std::size_t>& chosen);

  /// Without a hammer: number of cuts from which stability is learned, at most probing_cuts and as many as
  /// the stock has lanes for.
  std::size_t probingCuts() const { return probing_; }
  /// [m] largest depth of a probing or recommended cut: the height of the stock.
  double largestDepth() const { return planner_.height(); }
  /// @param index below probingCuts() @param feed_per_tooth [m] reduced where the axes are too slow: the
  /// limit of stability does not depend on it. @throws Error if the cut does not fit machine or stock.
  PlannedCut probing(std::size_t index, const Point& point, double feed_per_tooth) const;

  /// Cuts that verify the chart, each in its own lane. @throws Error if a cut does not fit machine or stock.
  PlannedCut stable(const Point& point, double feed_per_tooth) const;
  PlannedCut unstable(const Point& point, double feed_per_tooth) const;
  /// Cut at the unstable point that the chatter control is to stabilise; with control_time 0 none.
  /// @throws Error if it does not fit machine or stock.
  std::optional<PlannedCut> controlled(const Point& point, double feed_per_tooth) const;

  /// First of the points that stable() or unstable() accepts. @param reasons why the points before it were
  /// refused, in one line.
  std::optional<Point> firstStable(const std::vector<Point>& points, double feed_per_tooth,
                                   std::string& reasons) const;
  std::optional<Point> firstUnstable(const std::vector<Point>& points, double feed_per_tooth,
                                     std::string& reasons) const;

  const CutPlanner& planner() const { return planner_; }

 private:
  void addCandidates();
  void countProbingCuts(std::size_t tests);
  void planResonance();
  void planTuning();
  SlotRequest lightSlot(double speed, std::size_t lane) const;
  std::size_t verifyingCuts() const;
  /// @{ Lanes after those that verify the chart: resonance, chatter control, tuning.
  std::size_t controlLane() const;
  std::size_t tuningLane() const;
  /// @}
  PlannedCut verifying(const char* name, std::size_t lane, const Point& point, double feed_per_tooth,
                       double time) const;
  SlotRequest slotRequest(std::size_t feed) const;

  PlanParameters parameters_;
  CutPlanner planner_;
  std::vector<PlannedCut> air_cuts_, air_moves_, slots_, candidates_, tuning_;
  std::vector<SlotRequest> requests_;  // of the candidates
  std::vector<bool> placed_;           // of the candidates
  std::size_t verifying_lane_ = 0;     // the first
  std::size_t probing_ = 0;            // cuts, before the recommended one
  double shift_ = 0.0;                 // [m] of all lanes
  std::optional<PlannedCut> resonance_;
};

/// Result of the chatter detector for one window of a cut.
struct ChatterWindow {
  bool chatter = false;
  double frequency = NOT_A_NUMBER;  ///< [Hz]
  double severity = 0.0;            ///< [N]
  double stamp = NOT_A_NUMBER;      ///< [s] of its end
};

/// Verdict on a cut from all its windows.
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

/// Stable if at most a tenth of the windows chatters, since a window may contain a disturbance; chatter from
/// half of them on, since chatter takes time to grow; undecided in between; unknown with fewer than two
/// windows.
CutVerdict cutVerdict(const std::vector<ChatterWindow>& windows);

}  // namespace smartmill::session
