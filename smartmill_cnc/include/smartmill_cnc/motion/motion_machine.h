#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_cnc/controller/controller.h"
#include "smartmill_cnc/log.h"
#include "smartmill_cnc/motion/condition_schedule.h"
#include "smartmill_cnc/motion/motion_executor.h"
#include "smartmill_cnc/motion/motion_parameters.h"
#include "smartmill_cnc/motion/observation.h"
#include "smartmill_cnc/motion/outcome.h"
#include "smartmill_cnc/motion/override_control.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::cnc {

/// Permits and supervises motions: one at a time, only while armed; every program is checked against the
/// limits before MotionExecutor gets it. An alarm, a change of mode or a reset at the panel disarms.
class MotionMachine {
 public:
  /// @throws Error of MotionParameters::validate().
  MotionMachine(Controller& controller, const MotionParameters& parameters, Log& log);
  MotionMachine(const MotionMachine&) = delete;
  MotionMachine& operator=(const MotionMachine&) = delete;

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
  Status cancel(const std::string& why = "cancelled") { return executor_.cancel(why); }

  bool busy() const { return executor_.busy(); }
  Progress progress() const { return executor_.progress(); }
  /// Outcome of the last motion; returned once.
  std::optional<Outcome> takeOutcome() { return executor_.takeOutcome(); }
  /// Cutting conditions that began or ended since the last call, with their stamps.
  std::vector<CuttingCondition> takeConditions() { return conditions_.take(); }

 private:
  std::optional<Outcome> start(Motion motion, const std::string& program);
  std::optional<Outcome> refusal(const std::string& name) const;
  Status checkController();
  Status abandon(MotionCode code, const std::string& why);

  Controller& controller_;
  MotionParameters parameters_;
  Log& log_;
  bool armed_ = false;
  Observation observation_;
  OverrideControl overrides_;
  ConditionSchedule conditions_;
  MotionExecutor executor_;
};

}  // namespace smartmill::cnc
