#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_stability/chart/risk.h"
#include "smartmill_stability/chatter/chatter_advice.h"
#include "smartmill_stability/chatter/speed_search.h"

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
        "true: while motion is armed, the spindle and feed overrides follow the advice against chatter");
    table.number("override_spindle_low", spindle_low, "1", Range::closed(0.3, 1.0),
                 "smallest spindle override");
    table.number("override_spindle_high", spindle_high, "1", Range::closed(1.0, 1.5),
                 "largest spindle override");
    table.number("override_feed_high", feed_high, "1", Range::closed(1.0, 1.5), "largest feed override");
    table.number("override_feed_floor", feed_floor, "1", Range::closed(0.05, 1.0),
                 "smallest feed override; below it the tool rubs and wears");
    table.number("override_risk", risk, "1", Range::closed(0.0, 0.5),
                 "largest probability of chatter at a new spindle speed");
    table.number("override_speed_margin", speed_margin, "1", Range::openHigh(0.0, 0.1),
                 "relative error of the speed for which override_risk holds");
    table.number(
        "override_moves", moves, "1", Range::closed(1, 20),
        "largest number of speed changes in one cut; after further chatter the feed goes to its floor");
    table.number("override_settle_revolutions", settle_revolutions, "1", Range::closed(0.0, 1000.0),
                 "revolutions ignored after a new speed is reached");
    table.number("override_settle_time", settle_time, "s", Range::positive(),
                 "time within which the spindle must reach a new speed");
    table.number("load_target", load_target, "1", Range::closed(0.0, 2.0),
                 "spindle load over full scale to which the feed is controlled; 0: no load control");
    table.number("load_timeout", load_timeout, "s", Range::positive(),
                 "a load older than this does not change the feed");
    table.number("feed_rise", feed_rise, "1/s", Range::openLow(0.0, 1.0),
                 "rate of increase of the feed override by the load; the decrease is five times as fast");
  }
  /// @throws Error naming key and value.
  void validate() const { checkBounds(*this); }
};

/// Overrides requested from the controller.
struct OverrideRequest {
  double feed = 1.0, spindle = 1.0;  ///< [1] of the programmed values
  std::string reason;                ///< one line
  bool chatter = false;              ///< true: because of chatter; false: because of the load
  /// [rad/s], [m] Proposal for the next cut when no speed stabilises this one: largest removal rate at the
  /// accepted risk within the limits of the spindle override; 0: unknown.
  double next_speed = 0.0, next_depth = 0.0;
};

/// Controls feed and spindle override of the running cut.
/// Chatter: the spindle moves to the highest speed within its limits at which the machine, corrected from the
/// detected chatter, is stable at the accepted risk; the feed changes in proportion, which keeps the feed per
/// tooth. Without such a speed the feed goes to its floor, and a depth for the next cut is proposed.
/// Load: the feed decreases five times as fast as it increases; an unknown load changes nothing.
/// Acts only while motion is armed. A refusal is reported once and ends the attempts in this cut.
/// Time is taken from the data, which arrive in stamp order.
class MillingControl {
 public:
  /// Provides the estimated machine in a cut; empty while it is unknown.
  using Estimate = std::function<std::optional<UncertainSystem>(const Engagement&)>;
  /// @param window [revolutions] of a verdict of the detector
  MillingControl(const MillingControlParameters& parameters, int window, Estimate estimate);

  void handle(const CuttingCondition& condition);
  void handle(const CncState& state);
  void handle(const LoadSample& load);
  void handle(const ChatterState& state);
  /// @throws Error as the solvers on an invalid system.
  void handle(const ChatterAdvice& advice);

  /// The pending request, once.
  std::optional<OverrideRequest> takeRequest();
  /// Response of the controller to the last request. @param message of the controller, one line
  /// @param stamp [s] of the response, from which the spindle has override_settle_time
  void answer(bool accepted, const std::string& message, double stamp);
  /// Log lines since the last call.
  std::vector<std::string> takeNotes();

  /// Whether the spindle changes its speed or the window of the detector still contains the time before:
  /// verdicts are ignored.
  bool moving() const { return phase_ != Phase::watching; }
  double feed() const { return feed_; }        ///< [1] last requested
  double spindle() const { return spindle_; }  ///< [1] last requested

 private:
  enum class Phase { watching, requested, moving, settling };

  void begin(const CuttingCondition& condition);
  bool mayAct() const;
  void request(double feed, double spindle, const std::string& reason, bool chatter);
  void moveTo(const ChatterAdvice& advice, const StableSpeed& speed, bool corrected);
  void moveWithoutModel(const ChatterAdvice& advice);
  void reduceFeed(const ChatterAdvice& advice, const UncertainSystem* system);
  std::optional<UncertainSystem> systemOf(const ChatterAdvice& advice) const;
  double feedFor(double spindle) const;
  RiskOptions riskOptions() const;
  double lowest() const { return cut_->spindle_speed * parameters_.spindle_low; }    // [rad/s]
  double highest() const { return cut_->spindle_speed * parameters_.spindle_high; }  // [rad/s]

  MillingControlParameters parameters_;
  int window_;
  Estimate estimate_;
  std::optional<CuttingCondition> next_, cut_;
  std::optional<CncState> state_;
  Phase phase_ = Phase::watching;
  double spindle_ = 1.0, feed_ = 1.0;          // last requested
  double old_spindle_ = 1.0, old_feed_ = 1.0;  // before the last request
  double load_factor_ = 1.0;                   // [1] of the feed, by the load control
  double last_load_ = 0.0;                     // [s]
  double since_ = 0.0;                         // [s] start of the phase
  double requested_at_ = 0.0;                  // [s] newest state when chatter was answered
  std::optional<SpeedSearch> search_;          // of this cut, without a model
  int moves_ = 0;
  bool refused_ = false, at_floor_ = false;
  std::optional<OverrideRequest> request_;
  std::vector<std::string> notes_;
};

}  // namespace smartmill::stability
