#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_focas/server.h"
#include "smartmill_sim/controller/controller_options.h"
#include "smartmill_sim/controller/motion_state.h"

namespace smartmill::sim {

/// The simulated controller with ideal axes and spindle: each block has a trapezoidal speed profile and ends
/// with an exact stop; the torque of the spindle drive accelerates the inertia and carries the cut. advance()
/// moves the time on. All methods are thread-safe.
///
/// Dialect of the program text: see nc_block.h. A program begins in G90, G21, G94, G54 and G1 without F.
/// `#n=` is executed after all blocks before it. The program does not wait for M3 and M4; it waits for M5,
/// M19, M119, M30 and M2; M0 waits for cycle start. A block that is not understood, leaves the travel or
/// lacks F raises an alarm, which stops the machine and ends the session; so does a collision of the tool
/// with an obstacle.
///
/// Programs run by DNC or from the memory (mode MEM, cycle start).
class Controller : public focas::ControllerInterface {
 public:
  /// @throws Error of ControllerOptions::validate().
  explicit Controller(const ControllerOptions& options);
  ~Controller() override;
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
  /// External alarm (type EX); reset() clears it.
  void raiseAlarm(int number, const std::string& text);
  void emergency(bool on);
  /// The axes brake to rest on their path; cycle start resumes the motion.
  void feedHold();
  /// Factors on feed (0..2), rapid (0..1) and spindle speed (0.5..1.2).
  void setOverrides(double feed, double rapid, double spindle);

  focas::SysInfo sysInfo() const override;
  focas::Status status() const override;
  std::vector<double> machinePosition() const override;
  std::vector<double> absolutePosition() const override;
  std::vector<double> relativePosition() const override;
  std::vector<double> distanceToGo() const override;
  double actualFeed() const override;
  std::vector<double> spindleSpeed() const override;
  std::vector<double> spindleLoad() const override;
  std::vector<double> spindleMaxSpeed() const override;
  std::vector<double> servoLoad() const override;
  std::vector<double> servoCurrent() const override;
  std::vector<double> servoSpeed() const override;
  std::vector<double> servoLoopGain() const override;
  /// Variables 1..33, 100..199, 500..999 and 1133, initially vacant; work offsets 5221..5323; read-only
  /// positions 5001.., 5021.., 5041.. .
  focas::EwCode readMacro(int number, std::optional<double>* value) const override;
  focas::EwCode writeMacro(int number, std::optional<double> value) override;
  std::uint32_t alarmBits() const override;
  std::vector<focas::AlarmMessage> alarmMessages() const override;
  int runningProgram() const override;
  int mainProgram() const override;
  int sequenceNumber() const override;
  int blockCount() const override;
  std::string programPath() const override;
  std::string executingBlock() const override;
  std::string programText() const override;
  std::vector<focas::NumberedValue> parameters(int first, int last) const override;
  std::vector<focas::NumberedValue> diagnoses(int first, int last) const override;
  std::optional<focas::DateTime> dateTime() const override;
  focas::EwCode setDateTime(const focas::DateTime& date_time) override;
  focas::EwCode readPmc(focas::PmcArea area, int first, int last, focas::Bytes* bytes) const override;
  focas::EwCode writePmc(focas::PmcArea area, int first, const focas::Bytes& bytes) override;
  std::vector<focas::StoredProgram> programs() const override;
  focas::EwCode selectProgram(int number) override;
  focas::EwCode deleteProgram(int number) override;
  focas::EwCode rewindProgram() override;
  focas::EwCode storePrograms(const std::string& text) override;
  focas::EwCode fetchPrograms(int first, int last, std::string* text) const override;
  /// Runs the main program in MEM; resumes after M0 and feed hold.
  focas::EwCode cycleStart() override;
  /// Stops axes and spindle, drops the program, ends the session (EW_RESET), clears alarms.
  focas::EwCode reset() override;
  focas::EwCode dncStart() override;
  std::size_t dncData(const char* data, std::size_t size) override;
  focas::EwCode dncEnd() override;
  void dncCancel(int result) override;
  focas::EwCode dncAbort() override;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::sim
