#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_cnc/controller/controller.h"
#include "smartmill_cnc/controller/focas_controller.h"
#include "smartmill_cnc/controller/poller.h"
#include "smartmill_cnc/log.h"
#include "smartmill_cnc/motion/arming.h"
#include "smartmill_cnc/motion/motion_machine.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::cnc {

/// The bridge to the controller: maintains the connection, reads the state, runs programs. Used by one
/// thread: fetch(now), then step(time at which the replies arrived), at a fixed period; commands in between.
/// Time is an argument; only the wait for a reply uses a clock, bounded by the controller's reply timeout.
class Bridge {
 public:
  /// @param reconnect_period [s] > 0 between two attempts to connect
  /// @throws Error of MotionParameters::validate(), or on the period.
  Bridge(std::unique_ptr<Controller> controller, double reconnect_period, const MotionParameters& motion);
  ~Bridge();
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;

  /// Name for log lines and diagnostics.
  std::string controllerName() const { return controller_->name(); }

  /// Connects if an attempt is scheduled, then reads the controller. @param now [s] any steady time.
  void fetch(double now);
  /// Processes the reading of fetch() and advances the running motion. @param now [s] stamp of the reading.
  void step(double now);

  /// Last values; current only if connected.
  const CncState& state() const { return state_; }
  /// Load of the last step; empty without a connection.
  const std::optional<LoadSample>& load() const { return load_; }
  /// Temperatures read in the last step; empty in most steps, and when the controller offers none.
  const std::optional<MachineTemperature>& temperature() const { return temperature_; }
  /// Active alarms, as of the last reading.
  const std::vector<ControllerAlarm>& alarms() const { return alarms_; }
  /// Connections made and lost since the start.
  Poller::Counts connections() const { return poller_.counts(); }

  /// @param client that arms motion; every client can disarm
  Answer<ArmCode> arm(bool on, const std::string& client = {});
  /// The client for which motion is armed; empty while disarmed.
  const std::optional<ArmHolder>& holder() const { return holder_; }
  /// Sets the overrides of the running program while motion is armed. @param reason for the log
  OverrideAnswer setOverrides(const Overrides& wanted, const std::string& reason);
  /// Feed hold while motion is armed.
  Answer<HoldCode> hold();
  Answer<MacroCode> setMacro(int number, double value);

  /// Starts a motion. @return the refusal, if any; nothing was sent then.
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
  /// Stops the running motion; its Outcome follows at standstill.
  void cancel();
  /// Stops any motion and closes the connection, at the end of the process.
  void shutdown();

  bool busy() const { return motion_.busy(); }
  Progress progress() const { return motion_.progress(); }
  /// Outcome of the last motion; returned once.
  std::optional<Outcome> takeOutcome() { return motion_.takeOutcome(); }
  /// Cutting conditions that began or ended since the last call, with their stamps.
  std::vector<CuttingCondition> takeConditions() { return motion_.takeConditions(); }
  std::vector<LogEntry> takeLogEntries() { return log_.take(); }

 private:
  /// Stores the reason of a lost connection.
  void noteLoss(const Status& status);
  void endWithoutConnection(double now);
  void fetchTemperature(double now);

  Log log_;
  std::unique_ptr<Controller> controller_;
  Poller poller_;
  MotionMachine motion_;
  std::optional<ArmHolder> holder_;
  CncState state_;
  std::optional<LoadSample> load_;
  std::optional<MachineTemperature> temperature_;
  bool temperature_offered_ = true;  ///< of the present connection
  std::string temperature_refused_;  ///< logged
  double next_temperature_ = 0.0;    ///< [s]
  std::vector<ControllerAlarm> alarms_;
};

}  // namespace smartmill::cnc
