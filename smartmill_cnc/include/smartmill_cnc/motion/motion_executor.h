#pragma once

#include <optional>
#include <string>
#include <utility>

#include "smartmill_cnc/log.h"
#include "smartmill_cnc/motion/condition_schedule.h"
#include "smartmill_cnc/motion/motion_parameters.h"
#include "smartmill_cnc/motion/observation.h"
#include "smartmill_cnc/motion/outcome.h"
#include "smartmill_cnc/motion/progress_watch.h"

namespace smartmill::cnc {

struct Motion {
  std::string name;
  std::string program;  ///< accepted by checkProgram()
  bool orient = false;
  int axis = -1;  ///< of a jog
  std::optional<CuttingCondition> condition;
};

/// Executes one motion after the other. Phases: opening (the controller prepares to accept programs),
/// sending, running (ends when all blocks have been executed, the distance to go is zero and nothing has
/// moved for settle_time; Dunwoody 6.2 and 7.1), stopping after a cancel.
class MotionExecutor {
 public:
  enum class Phase { idle, opening, sending, running, stopping };

  /// The arguments must outlive it.
  MotionExecutor(Controller& controller, const MotionParameters& parameters, const Observation& observation,
                 ConditionSchedule& conditions, Log& log);

  /// Precondition: not busy.
  void start(Motion motion);
  /// Advances the motion by one reading. @return a failure if the connection is lost or the controller
  /// refuses the program, whereupon the caller ends the motion.
  Status step();
  /// Stops the motion; its Outcome follows at standstill. @return a failure only if it lost the connection.
  Status cancel(const std::string& why);
  /// Ends the motion.
  void finish(MotionCode code, const std::string& message);

  bool busy() const { return phase_ != Phase::idle; }
  Phase phase() const { return phase_; }
  const std::string& name() const { return motion_.name; }  ///< of the last motion
  Progress progress() const;
  std::optional<Outcome> takeOutcome() { return std::exchange(outcome_, std::nullopt); }
  /// The clock has jumped.
  void shift(double jump);

 private:
  void enter(Phase phase);
  Status open();
  Status send();
  Status run();
  bool ended() const;
  Status checkStall();
  Status stop(const std::string& why);
  void endStop();

  Controller& controller_;
  const MotionParameters& parameters_;
  const Observation& observation_;
  ConditionSchedule& conditions_;
  Log& log_;
  Phase phase_ = Phase::idle;
  Motion motion_;
  double entered_ = 0.0;  // [s] start of the phase
  ProgressWatch watch_;
  std::string stop_reason_;
  std::optional<Outcome> outcome_;
};

}  // namespace smartmill::cnc
