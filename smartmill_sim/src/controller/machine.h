#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "controller/calendar_clock.h"
#include "controller/dnc_session.h"
#include "controller/motor_heating.h"
#include "controller/pmc_memory.h"
#include "controller/program_memory.h"
#include "smartmill_sim/controller/controller_options.h"
#include "smartmill_sim/controller/motion_state.h"

namespace smartmill::sim {

/// The machine behind a Controller: its parts, and what the operator and the DNC session do with them. Not
/// thread-safe.
class ControlledMachine {
 public:
  explicit ControlledMachine(const ControllerOptions& options);
  ControlledMachine(const ControlledMachine&) = delete;
  ControlledMachine& operator=(const ControlledMachine&) = delete;

  void step(double dt);
  double now() const { return now_; }  ///< [s]

  MotionState motion() const;
  int mode() const { return mode_; }  ///< focas::Aut
  bool isEmergency() const { return emergency_; }
  std::optional<double> variable(int number) const { return executor.readVariable(number, now_); }

  // The operator.
  void setMode(int aut);
  void emergency(bool on);
  void reset();
  void setOverrides(const Overrides::Factors& panel) { apply(panel, overrides.panel); }
  /// PMC program: multiplies the overrides of the panel by the percentages of the data table.
  void updateDataTableOverrides();
  focas::EwCode cycleStart();
  void alarm(const focas::AlarmMessage& message) { alarmAt(now_, message); }

  // The DNC session.
  focas::EwCode openSession();
  void cancelSession() { halt(now_, focas::EW_OK); }

  const ControllerOptions options;
  Variables variables;
  ProgramMemory memory;
  PmcMemory pmc;
  CalendarClock calendar;
  std::vector<focas::AlarmMessage> alarms;
  double spindle_load = 0.0;                                              // [percent]
  std::array<double, 3> servo_load{{0, 0, 0}}, servo_current{{0, 0, 0}};  // [percent], [A]
  MotorHeating heating;
  Overrides overrides;
  AxesMotion axes;
  SpindleControl spindle;
  BlockExecutor executor;
  ProgramRunner program;
  DncSession session;

 private:
  void halt(double time, focas::EwCode why);
  void alarmAt(double time, const focas::AlarmMessage& message);
  void apply(const Overrides::Factors& from, Overrides::Factors& to);
  void checkMotion();

  // Time is base_ + steps_ dt_ [s].
  double now_ = 0.0, base_ = 0.0, dt_ = 0.0;
  std::uint64_t steps_ = 0;
  double checked_ = -1.0;  // [s] last check of the motion
  int mode_;
  bool emergency_ = false;
};

}  // namespace smartmill::sim
