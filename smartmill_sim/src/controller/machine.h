#pragma once

#include <array>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "controller/pmc_memory.h"
#include "controller/program_memory.h"
#include "controller/variables.h"
#include "smartmill_sim/controller/controller.h"
#include "smartmill_sim/controller/nc_block.h"
#include "smartmill_sim/controller/path_move.h"
#include "smartmill_sim/controller/spindle_motion.h"

namespace smartmill::sim {

/// Received program text that has not run.
class BlockBuffer {
 public:
  std::size_t size() const { return text_.size() - position_; }
  void append(const char* text, std::size_t size);
  void clear();
  bool hasLine() const { return text_.find_first_of("\r\n", position_) != std::string::npos; }
  /// The next line without its end; nullopt: no complete line.
  std::optional<std::string> takeLine();
  /// The next text, at most `most` bytes.
  std::string preview(std::size_t most) const { return text_.substr(position_, most); }

 private:
  std::string text_;
  std::size_t position_ = 0;
};

/// The machine behind a Controller: panel, programs, axes, spindle. Not thread-safe.
class ControlledMachine {
 public:
  explicit ControlledMachine(const ControllerOptions& options);

  void step(double dt);
  MotionState motion() const;

  // Indicated state.
  std::array<double, 3> position() const { return move_.position(now_); }
  std::array<double, 3> workPosition() const;
  std::array<double, 3> distanceToGo() const;
  double pathSpeed() const { return move_.speed(now_); }
  std::array<double, 3> velocity() const { return move_.velocity(now_); }
  double spindleSpeed() const { return spindle_.speed(now_); }
  focas::Status status() const;
  std::string programText() const;
  int runningProgram() const { return running_program_; }
  int mainProgram() const { return main_program_; }
  PmcSignals signals() const;
  bool dwells() const { return running_ && block_.dwell && now_ < wait_until_; }
  bool stopped() const { return stopped_ || held_; }

  // The operator.
  void setMode(int aut);
  void emergency(bool on);
  void reset();
  void feedHold();
  void setOverrides(double feed, double rapid, double spindle);
  /// PMC program: multiplies the overrides of the panel by the percentages of the data table.
  void updateDataTableOverrides();
  focas::EwCode cycleStart();
  void alarm(const focas::AlarmMessage& message);
  void setSpindleTorque(double torque);

  // The DNC session.
  focas::EwCode openSession();
  std::size_t receive(const char* data, std::size_t size);
  focas::EwCode closeSession();
  void cancelSession();
  focas::EwCode takeAbortCode();

  // Memory.
  std::optional<double> readVariable(int number) const;
  focas::EwCode select(int number);
  focas::EwCode erase(int number);
  focas::EwCode store(const std::string& text, const focas::DateTime& now);

  const ControllerOptions options;
  Variables variables;
  ProgramMemory memory;
  PmcMemory pmc;
  std::vector<focas::AlarmMessage> alarms;
  int sequence = 0, blocks = 0;
  std::string block_text;
  double spindle_load = 0.0;                                              // [percent]
  std::array<double, 3> servo_load{{0, 0, 0}}, servo_current{{0, 0, 0}};  // [percent], [A]
  std::int64_t clock_offset = 0;                                          // [s]

 private:
  struct Modal {
    int motion = 1;  // G1
    bool relative = false, inch = false, per_turn = false;
    std::size_t work = 0;
    double feed = 0.0;   // in units of the text, per minute or per revolution
    double speed = 0.0;  // [rad/s] commanded, without sign and override
  };
  enum class Rotation { off, forwards, backwards };

  bool busy() const { return running_ || buffer_.hasLine(); }
  bool moving() const { return now_ < move_.end(); }
  void halt(focas::EwCode why);
  void haltAt(double time, focas::EwCode why);
  void raiseProgramAlarm(double time, const NcAlarm& alarm);
  void beginProgram();
  bool takeBlock(double time);
  void start(double time, const NcBlock& block);
  void startSpindle(double time, const NcBlock& block);
  void planPath(const NcBlock& block);
  std::array<double, 3> targetOf(const NcBlock& block, const std::array<double, 3>& from) const;
  std::array<double, 2> centreOf(const NcBlock& block, const std::array<double, 3>& from,
                                 const std::array<double, 3>& to) const;
  void checkTravel(const PathMove& move) const;
  void append(const PathMove& move, bool rapid);
  double feedOf(const PathMove& move, bool rapid) const;
  double unit() const;
  void beginMove(double time);
  void replan();
  void continueBlock(double time);
  bool beginNextMove(double time);
  void orient(double time, double steps);
  double commandedSpeed() const;
  void checkCollision();

  // Time is base_ + steps_ dt_ [s].
  double now_ = 0.0, base_ = 0.0, dt_ = 0.0;
  std::uint64_t steps_ = 0;
  double checked_ = -1.0;  // [s] last check of the obstacles

  int mode_;
  bool emergency_ = false, held_ = false, stopped_ = false;                     // stopped: M0
  double held_since_ = 0.0;                                                     // [s]
  double feed_override_ = 1.0, rapid_override_ = 1.0, spindle_override_ = 1.0;  // set at the panel
  double data_feed_override_ = 1.0, data_spindle_override_ = 1.0;               // from the data table

  PathMove move_;  // the running or last one
  bool move_rapid_ = false;
  struct Pending {
    PathMove move;
    bool rapid = false;
  };
  std::deque<Pending> pending_;  // of the running block
  SpindleMotion spindle_;
  Rotation rotation_ = Rotation::off;
  bool oriented_ = false;
  double torque_ = 0.0;  // [N m] of the cut

  Modal modal_;
  bool session_ = false, from_memory_ = false;
  focas::EwCode abort_ = focas::EW_OK;  // why the session ended, until reported
  BlockBuffer buffer_;
  bool running_ = false;
  NcBlock block_;            // the running block
  double wait_until_ = 0.0;  // [s] end of the running block's wait
  int running_program_ = 0, main_program_ = 0;
  int last_m_ = 0;
};

}  // namespace smartmill::sim
