#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_focas/server.h"

namespace smartmill::sim {

struct ControllerOptions {
  MachineAxes axes;                              ///< travel, rapid, acceleration, home (where it starts)
  double spindle_max_speed = 0.0;                ///< [rad/s] a higher S is taken as this
  double spindle_acceleration = 0.0;             ///< [rad/s2]
  std::array<double, 3> work_offset{{0, 0, 0}};  ///< [m] machine minus absolute position
  focas::SysInfo info = fineInfo();              ///< of the controller
  int mode = focas::AUT_REMOTE;                  ///< focas::Aut, at its panel
  std::size_t buffer_size = 1024;                ///< [byte] of DNC text not yet run

  /// @throws Error naming key and value.
  void validate() const;

  /// Of a model's sections axes and spindle. What it leaves out: travel x -250..250, y -200..200, z -300..0
  /// mm, home 0 0 0, rapid 30 m/min, 5 m/s2; spindle to 20000 rpm, 10000 rpm/s.
  static ControllerOptions ofModel(const MachineModel& model);
  /// Positions in 0.1 um.
  static focas::SysInfo fineInfo();
};

/// Where the machine is and how it moves.
struct MotionState {
  std::array<double, 3> position{{0, 0, 0}};  ///< [m] machine position of x, y, z
  std::array<double, 3> velocity{{0, 0, 0}};  ///< [m/s]
  double spindle_angle = 0.0;                 ///< [rad] of tooth 1, 0..2 pi
  double spindle_speed = 0.0;                 ///< [rad/s]
};

/// The simulated controller and the axes and the spindle that obey it exactly: blocks with trapezoidal speed
/// and an exact stop at the end of each, spindle with a constant acceleration. Time comes in through
/// advance(). Every method may be called from any thread.
///
/// Dialect of the program text: see nc_block.h. A program begins in G90 and G1 without F. `#n=value` is done
/// when all blocks before it are, M3 is not waited for, M5, M119, M30 and M2 are. A block that is not
/// understood, would leave the travel or lacks F raises an alarm, which stops everything and ends the
/// session.
class Controller : public focas::ControllerInterface {
 public:
  /// @throws Error of ControllerOptions::validate().
  explicit Controller(const ControllerOptions& options);
  ~Controller() override;
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  /// Advances the machine. @param dt [s] one step. @param states becomes the states of the ends of the steps,
  /// count of them.
  void advance(double dt, std::size_t count, std::vector<MotionState>& states);
  MotionState motion() const;

  /// What the load meters show. [percent]
  void setSpindleLoad(double percent);
  void setServoLoad(const std::array<double, 3>& percent);

  /// The panel. Leaving DNC (focas::AUT_REMOTE) while blocks run or a session is open stops everything and
  /// ends the session (EW_MODE). @param aut focas::Aut
  void setMode(int aut);
  /// An alarm from outside (type EX); reset() clears it.
  void raiseAlarm(int number, const std::string& text);
  void emergency(bool on);

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
  /// Variables 100..199, 500..999 and 1133, vacant in the beginning.
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
