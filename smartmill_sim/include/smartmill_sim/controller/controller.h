#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "smartmill_focas/controller_interface.h"
#include "smartmill_sim/controller/controller_options.h"
#include "smartmill_sim/controller/motion_state.h"

namespace smartmill::sim {

/// The simulated controller with ideal axes and spindle: each block has a trapezoidal speed profile and ends
/// with an exact stop; the torque of the spindle drive accelerates the inertia and carries the cut. advance()
/// moves the time on. All methods are thread-safe.
///
/// Dialect of the program text: see nc_block.h. A program begins in G90, G21, G94, G54 and G1 without F.
/// `#n=` is executed after all blocks before it. The program does not wait for M3 and M4; it waits for M5,
/// M6, M19, M119, M30 and M2; M0 waits for cycle start. A block that is not understood, leaves the travel or
/// lacks F raises an alarm, which stops the machine and ends the session; so does a collision of the tool
/// with an obstacle.
///
/// Programs run by DNC or from the memory (mode MEM, cycle start).
class Controller {
 public:
  /// @throws Error of ControllerOptions::validate().
  explicit Controller(const ControllerOptions& options);
  ~Controller();
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  /// Advances the machine by `count` steps. @param dt [s] one step @param states receives the state at the
  /// end of each step
  void advance(double dt, std::size_t count, std::vector<MotionState>& states);
  MotionState motion() const;

  /// Indicated loads [percent].
  void setSpindleLoad(double percent);
  void setServoLoad(const std::array<double, 3>& percent);
  /// Motor currents of the axes [A].
  void setServoCurrent(const std::array<double, 3>& amperes);
  /// Torque of the cut on the spindle [N m].
  void setSpindleTorque(double torque);

  /// Mode at the panel. Leaving DNC (focas::AUT_REMOTE) while blocks run or a session is open stops the
  /// machine and ends the session (EW_MODE). @param aut focas::Aut
  void setMode(int aut);
  /// External alarm (type EX); a reset clears it.
  void raiseAlarm(int number, const std::string& text);
  void emergency(bool on);
  /// The axes brake to rest on their path; cycle start resumes the motion.
  void feedHold();
  /// Factors on feed (0..2), rapid (0..1) and spindle speed (0.5..1.2).
  void setOverrides(double feed, double rapid, double spindle);

  /// What a FOCAS client reads and commands (src/controller/calls/); valid as long as this object.
  focas::ControllerInterface calls() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::sim
