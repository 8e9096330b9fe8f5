#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_cnc/controller/controller.h"
#include "smartmill_cnc/log.h"
#include "smartmill_cnc/motion/nc_program.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::cnc {

struct MotionParameters {
  bool read_only = true;
  double condition_lead = 0.3;
  double settle_time = 0.1;
  double standstill_speed = 0.2;
  double stall_timeout = 60.0;
  double stop_timeout = 5.0;
  double open_timeout = 3.0;
  MotionLimits limits;

  /// Without the limits, which have their own declare().
  void declare(ParameterTable& table) {
    table.flag("read_only", read_only, "true: motion cannot be armed, nothing is written to the controller");
    table.number("condition_lead", condition_lead, "s", Range::closed(0.0, 10.0),
                 "time by which a cutting condition is announced before it begins or ends");
    table.number("settle_time", settle_time, "s", Range::positive(),
                 "standstill after which a motion has ended");
    table.number("standstill_speed", standstill_speed, "rad/s", Range::positive(),
                 "spindle speed below which the spindle counts as stopped");
    table.number("stall_timeout", stall_timeout, "s", Range::positive(),
                 "time without progress after which a motion is cancelled, except in feed hold");
    table.number("stop_timeout", stop_timeout, "s", Range::positive(),
                 "longest time for a cancelled motion to stop");
    table.number("open_timeout", open_timeout, "s", Range::positive(),
                 "longest time in which the controller may refuse a program after a cancelled one");
  }

  /// @throws Error naming key and value.
  void validate() const;
};

/// Codes of the actions RunProgram, Jog, OrientSpindle.
enum class MotionCode : std::uint8_t {
  ok = 0,
  cancelled = 1,
  not_connected = 2,
  not_armed = 3,
  wrong_mode = 4,
  limit = 5,
  alarm = 6,
  lost = 7,
  busy = 8,
  bad_goal = 9
};
/// Codes of the service SetOverrides.
enum class OverrideCode : std::uint8_t { ok = 0, not_connected = 1, not_armed = 2, limit = 3, refused = 4 };
/// Codes of the service FeedHold.
enum class HoldCode : std::uint8_t { ok = 0, not_connected = 1, not_armed = 2, refused = 3 };
/// Codes of the service ArmMotion.
enum class ArmCode : std::uint8_t { ok = 0, not_connected = 1, wrong_mode = 2, alarm = 3 };
/// Codes of the service SetMacro.
enum class MacroCode : std::uint8_t { ok = 0, not_connected = 1, refused = 2 };

template <class Code>
struct Answer {
  Code code = Code::ok;
  std::string message;  ///< one line
};
using Outcome = Answer<MotionCode>;

struct OverrideAnswer : Answer<OverrideCode> {
  Overrides taken;  ///< valid with OverrideCode::ok
};

struct Progress {
  std::size_t bytes_sent = 0, bytes_total = 0;
  std::string stage;            ///< opening, sending, running, stopping; empty when idle
  double distance_to_go = 0.0;  ///< [m] of the jogged axis
};

/// State machine of the motions: one at a time, only while armed; every program is checked against the limits
/// before it is sent. Phases: opening (the controller prepares to accept programs), sending, running (ends
/// when all blocks have been executed, the distance to go is zero and nothing has moved for settle_time;
/// Dunwoody 6.2 and 7.1), stopping after a cancel. An alarm, a change of mode or a reset at the panel
/// disarms.
class MotionMachine {
 public:
  /// @throws Error of MotionParameters::validate().
  MotionMachine(Controller& controller, const MotionParameters& parameters, Log& log);

  /// Advances the running motion. @param reading of this period @param now [s] its stamp
  /// @return a failure only if it lost the connection.
  Status step(const Reading& reading, double now);
  /// Ends a running motion after a lost connection. @return the reason, with the name of the ended motion.
  std::string lost(const std::string& why, double now);

  bool armed() const { return armed_; }
  bool readOnly() const { return parameters_.read_only; }
  Result<Answer<ArmCode>> arm();
  Status disarm();

  /// Starts a motion. @return the refusal, if any; nothing was sent then.
  std::optional<Outcome> runProgram(const std::string& name, const std::string& program,
                                    const CuttingCondition& condition);
  /// @param distance [m]. @param feed [m/s], 0: rapid.
  std::optional<Outcome> jog(const std::string& axis, double distance, double feed);
  /// @param angle [rad]
  std::optional<Outcome> orient(double angle);
  /// Sets the overrides of the running program; its end resets them to 1. @return a failure only if it lost
  /// the connection.
  Result<OverrideAnswer> setOverrides(const Overrides& wanted, const std::string& reason);
  /// Stops the running motion; its Outcome follows at standstill. @param why for the Outcome
  Status cancel(const std::string& why = "cancelled");

  bool busy() const { return phase_ != Phase::idle; }
  Progress progress() const;
  /// Outcome of the last motion; returned once.
  std::optional<Outcome> takeOutcome() { return std::exchange(outcome_, std::nullopt); }
  /// Cutting conditions that began or ended since the last call, with their stamps.
  std::vector<CuttingCondition> takeConditions() { return std::exchange(conditions_, {}); }

 private:
  enum class Phase { idle, opening, sending, running, stopping };
  struct Motion {
    std::string name;
    std::string program;
    bool orient = false;
    int axis = -1;  // of a jog
    std::optional<CuttingCondition> condition;
  };

  std::optional<Outcome> start(Motion motion, const std::string& program);
  std::optional<Outcome> refusal(const std::string& name) const;
  std::optional<std::size_t> axisIndex(int axis) const;
  std::string alarmText() const;
  std::string overrideFault(const Overrides& wanted) const;
  Status resetOverrides();
  std::string modeText() const;
  std::string failureText(const Failure& failure) const;
  void setArmed(bool armed);
  void enter(Phase phase);
  void followClock(double now);
  Status checkController();
  Status abandonMotion(MotionCode code, const std::string& why);
  Status stop(Outcome outcome);
  Status open();
  void announceCondition();
  Status send();
  Status run();
  bool ended() const;
  Status checkStall();
  void endStop();
  void finish(const Outcome& outcome);

  Controller& controller_;
  MotionParameters parameters_;
  Log& log_;

  bool armed_ = false;
  bool overridden_ = false;         // the controller's overrides may differ from 1
  Overrides overrides_;             // last accepted
  std::optional<Reading> reading_;  // of the last step; empty before the first and after a loss
  double now_ = 0.0;                // [s]
  Phase phase_ = Phase::idle;
  Motion motion_;
  double entered_ = 0.0;     // [s] start of the phase
  double progressed_ = 0.0;  // [s]
  std::optional<double> still_since_;
  CncState last_progress_;  // state at the last progress
  Outcome stopping_outcome_;
  std::optional<Outcome> outcome_;
  std::vector<CuttingCondition> conditions_;
  double condition_from_ = 0.0, condition_to_ = 0.0;  // [s] of the running motion
};

}  // namespace smartmill::cnc
