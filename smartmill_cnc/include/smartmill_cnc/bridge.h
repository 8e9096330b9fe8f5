#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_cnc/controller/controller.h"
#include "smartmill_cnc/controller/focas_controller.h"
#include "smartmill_cnc/controller/poller.h"
#include "smartmill_cnc/log.h"
#include "smartmill_cnc/motion/motion_machine.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::cnc {

/// The bridge to the controller: keeps the connection, reads the state, runs programs. One thread drives it:
/// fetch(now), then step(time at which the replies arrived), at a fixed period; the commands in between.
/// Nothing here looks at a clock, except that waiting for an answer is bounded by the controller's reply
/// timeout.
class Bridge {
 public:
  /// @param reconnect_period [s] > 0 between two attempts to connect
  /// @throws Error of MotionParameters::validate(), or on the period.
  Bridge(std::unique_ptr<Controller> controller, double reconnect_period, const MotionParameters& motion);
  ~Bridge();
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;

  /// Of log lines and diagnostics.
  std::string controllerName() const { return controller_->name(); }

  /// Connects when it is time to, reads the controller. @param now [s] any steady time.
  void fetch(double now);
  /// Takes what fetch() read and goes on with the running motion. @param now [s] the stamp of what was read.
  void step(double now);

  /// Last values; connected tells whether they are current.
  const CncState& state() const { return state_; }
  /// Read in the last step, nothing when not connected.
  const std::optional<LoadSample>& load() const { return load_; }
  /// Those that the controller shows; as of the last connection.
  const std::vector<ControllerAlarm>& alarms() const { return alarms_; }
  /// Connections that came about and that were lost, since the start.
  Poller::Counts connections() const { return poller_.counts(); }
  /// [m] Increment of the controller's positions.
  double positionIncrement() const { return increment_; }

  Answer<ArmCode> arm(bool on);
  /// Of the running program, while motion is armed. @param reason for the log
  OverrideAnswer setOverrides(const Overrides& wanted, const std::string& reason);
  /// Feed hold, while motion is armed.
  Answer<HoldCode> hold();
  Answer<MacroCode> setMacro(int number, double value);

  /// Starts a motion; an Outcome now is a refusal, nothing was sent (MotionMachine).
  std::optional<Outcome> runProgram(const std::string& name, const std::string& program,
                                    const CuttingCondition& condition) {
    return motion_.runProgram(name, program, condition);
  }
  /// @param distance [m]. @param feed [m/s], 0: rapid.
  std::optional<Outcome> jog(const std::string& axis, double distance, double feed) {
    return motion_.jog(axis, distance, feed);
  }
  /// @param angle [rad]
  std::optional<Outcome> orient(double angle) { return motion_.orient(angle); }
  /// Stops the running motion; its Outcome follows when it stands.
  void cancel();
  /// Stops and closes at once: the program ends.
  void shutdown();

  bool busy() const { return motion_.busy(); }
  Progress progress() const { return motion_.progress(); }
  /// How the last motion ended, once.
  std::optional<Outcome> takeOutcome() { return motion_.takeOutcome(); }
  /// Cutting conditions that began or ended since the last call, with their stamps.
  std::vector<CuttingCondition> takeConditions() { return motion_.takeConditions(); }
  std::vector<Note> takeNotes() { return log_.take(); }

 private:
  /// Remembers why the connection went, when it did.
  void notice(const Status& status);
  void endWithoutConnection(double now);

  Log log_;
  std::unique_ptr<Controller> controller_;
  Poller poller_;
  MotionMachine motion_;
  CncState state_;
  std::optional<LoadSample> load_;
  std::vector<ControllerAlarm> alarms_;
  double increment_ = 1e-6;  // [m]
};

}  // namespace smartmill::cnc
