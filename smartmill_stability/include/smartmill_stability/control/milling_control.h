#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_stability/chart/risk.h"
#include "smartmill_stability/chatter/chatter_advice.h"

namespace smartmill::stability {

struct MillingControlParameters {
  bool adaptive = false;
  double spindle_low = 0.8, spindle_high = 1.2;
  double feed_high = 1.2, feed_floor = 0.4;
  double risk = 0.05, speed_margin = 0.01;
  int moves = 3;
  double settle_revolutions = 12.0, settle_time = 2.0;
  double load_target = 0.0, load_timeout = 0.5;
  double feed_rise = 0.05;

  void declare(ParameterTable& table) {
    table.flag(
        "adaptive", adaptive,
        "true: while motion is armed, overrides of spindle and feed follow the advice against chatter");
    table.number("override_spindle_low", spindle_low, "1", Range::closed(0.3, 1.0),
                 "least override of the spindle");
    table.number("override_spindle_high", spindle_high, "1", Range::closed(1.0, 1.5), "and the largest");
    table.number("override_feed_high", feed_high, "1", Range::closed(1.0, 1.5),
                 "largest override of the feed");
    table.number("override_feed_floor", feed_floor, "1", Range::closed(0.05, 1.0),
                 "the least: a tool that rubs wears out");
    table.number("override_risk", risk, "1", Range::closed(0.0, 0.5),
                 "largest probability of chatter at the speed that is gone to");
    table.number("override_speed_margin", speed_margin, "1", Range::openHigh(0.0, 0.1),
                 "and also for speeds this much off");
    table.number("override_moves", moves, "1", Range::closed(1, 20),
                 "of the spindle in one cut; if it chatters then, the feed goes to its floor");
    table.number("override_settle_revolutions", settle_revolutions, "1", Range::closed(0.0, 1000.0),
                 "after a new speed is reached before what is seen counts");
    table.number("override_settle_time", settle_time, "s", Range::positive(),
                 "within which the spindle reaches its new speed");
    table.number("load_target", load_target, "1", Range::closed(0.0, 2.0),
                 "of the spindle's full scale, to which the feed is led; 0: the load is not followed");
    table.number("load_timeout", load_timeout, "s", Range::positive(),
                 "an older load is not known: it changes nothing");
    table.number("feed_rise", feed_rise, "1/s", Range::openLow(0.0, 1.0),
                 "of the feed's override by the load; it falls five times as fast");
  }
  /// @throws Error naming key and value.
  void validate() const { checkBounds(*this); }
};

/// What the controller is asked for.
struct OverrideRequest {
  double feed = 1.0, spindle = 1.0;  ///< [1] of what is programmed
  std::string reason;                ///< one line
  bool chatter = false;              ///< because of it; else the load
  /// What the next cut may do where this one is not to be saved: largest removal at the asked risk within the
  /// limits of the spindle's override; 0: not known. [rad/s], [m]
  double next_speed = 0.0, next_depth = 0.0;
};

/// Leads feed and spindle override of the running cut. Chatter: the spindle goes to the fastest speed within
/// its limits at which the machine, corrected by the chatter that was seen, stays stable at the asked risk;
/// the feed goes with it, so that the chip stays as thick. Where there is none, the feed goes to its floor
/// and the next cut's depth is said. Load: the feed falls five times as fast as it rises, an unknown load
/// changes nothing. Only while motion is armed; a refusal is said once and ends the attempts in this cut.
/// Time comes with the data, in the order of their stamps.
class MillingControl {
 public:
  /// What is believed of the machine in a cut; empty while it is not known.
  using Believed = std::function<std::optional<UncertainSystem>(const Engagement&)>;
  /// @param window [revolutions] of the detector's verdicts
  MillingControl(const MillingControlParameters& parameters, int window, Believed believed);

  void handle(const CuttingCondition& condition);
  void handle(const CncState& state);
  void handle(const LoadSample& load);
  void handle(const ChatterState& state);
  /// @throws Error as the solvers on an impossible system.
  void handle(const ChatterAdvice& advice);

  /// What is to be asked of the controller now, once.
  std::optional<OverrideRequest> takeRequest();
  /// What it said to that. @param message its line
  void answer(bool taken, const std::string& message);
  /// Lines for people since the last call.
  std::vector<std::string> takeNotes();

  /// The machine goes to another speed, or what is seen still belongs to the time before: a verdict says
  /// nothing.
  bool moving() const { return phase_ != Phase::watching; }
  double feed() const { return feed_; }        ///< [1] asked for last
  double spindle() const { return spindle_; }  ///< [1]

 private:
  enum class Phase { watching, moving, settling };

  void begin(const CuttingCondition& condition);
  bool mayAct() const;
  void ask(double feed, double spindle, const std::string& reason, bool chatter);
  void goTo(const ChatterAdvice& advice, const StableSpeed& speed, bool corrected);
  void stepAside(const ChatterAdvice& advice);
  void backOff(const ChatterAdvice& advice, const UncertainSystem* system);
  std::optional<UncertainSystem> systemOf(const ChatterAdvice& advice) const;
  double feedFor(double spindle) const;
  RiskOptions riskOptions() const;
  double lowest() const { return cut_->spindle_speed * parameters_.spindle_low; }    // [rad/s]
  double highest() const { return cut_->spindle_speed * parameters_.spindle_high; }  // [rad/s]

  MillingControlParameters parameters_;
  int window_;
  Believed believed_;
  std::optional<CuttingCondition> next_, cut_;
  std::optional<CncState> state_;
  Phase phase_ = Phase::watching;
  double spindle_ = 1.0, feed_ = 1.0;          // asked for last
  double old_spindle_ = 1.0, old_feed_ = 1.0;  // before
  double load_share_ = 1.0;                    // [1] what the load leaves of the feed
  double last_load_ = 0.0;                     // [s]
  double since_ = 0.0;                         // [s] of the phase
  double moved_at_ = 0.0;                      // [s]
  int moves_ = 0;
  bool refused_ = false, at_floor_ = false;
  std::optional<OverrideRequest> request_;
  std::vector<std::string> notes_;
};

}  // namespace smartmill::stability
