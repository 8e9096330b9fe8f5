#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>

#include "controller/axes_motion.h"
#include "controller/block_buffer.h"
#include "controller/overrides.h"
#include "controller/path_planner.h"
#include "controller/spindle_control.h"
#include "controller/variables.h"

namespace smartmill::sim {

/// Executes the blocks of a program on axes and spindle. Times [s] are those of the caller's clock.
class ProgramRunner {
 public:
  /// The arguments must outlive the runner.
  ProgramRunner(const ControllerOptions& options, const Overrides& overrides, Variables& variables,
                AxesMotion& axes, SpindleControl& spindle);

  /// State that a program begins with. @param number of the program; 0: by DNC
  void begin(int number);
  /// The text of a program of the memory.
  void load(const std::string& text);
  /// DNC text that follows the text so far.
  void append(const std::string& text) { buffer_.append(text); }
  /// The text is complete: its last line needs no end.
  void endText();
  /// Free space [byte] for text.
  std::size_t space() const;
  /// Stops axes and spindle and drops the program.
  void halt(double time);

  /// Executes blocks from the present time on until one lasts beyond the end. @throws NcAlarm, at time()
  void advance(double now, double end);
  double time() const { return time_; }  ///< [s] of the present block

  /// Feed hold: the axes brake to rest on their path.
  void hold(double now);
  /// Resumes after M0 or feed hold. @return whether there was one
  bool resume(double now);
  /// Applies changed overrides to the present motion.
  void updateFeed(double now);

  std::optional<double> readVariable(int number, double now) const;
  std::array<double, 3> workPosition(double now) const;  ///< [m]

  bool fromMemory() const { return from_memory_; }
  bool busy() const { return running_ || buffer_.hasLine(); }
  bool running() const { return running_; }  ///< a block
  bool held() const { return held_; }
  bool stopped() const { return stopped_; }  ///< M0
  bool dwells(double now) const { return running_ && block_.dwell && now < wait_until_; }
  bool waitsForM() const { return running_ && block_.m_code; }

  /// Indicated state.
  struct Indicated {
    int program = 0, sequence = 0, blocks = 0;
    std::string block;
    int m_code = 0;  ///< last one
  };
  const Indicated& indicated() const { return indicated_; }
  std::string text() const;  ///< the block and the text that follows

 private:
  bool takeBlock();
  void start(const NcBlock& block);
  void writeVariable(int number, std::optional<double> value);
  void startSpindle(const NcBlock& block);
  void planPath(const NcBlock& block);
  double feedOf(const AxesMotion::Segment& segment) const;
  void beginNextSegment();
  void continueBlock();

  const ControllerOptions& options_;
  const Overrides& overrides_;
  Variables& variables_;
  AxesMotion& axes_;
  SpindleControl& spindle_;

  BlockBuffer buffer_;
  NcModal modal_;
  Indicated indicated_;
  int number_ = 0;  // of the program, as it began
  bool from_memory_ = false, running_ = false, held_ = false, stopped_ = false;
  NcBlock block_;                  // the running block
  double now_ = 0.0, time_ = 0.0;  // [s] present time, time of the block
  double wait_until_ = 0.0;        // [s] end of the running block's wait
  double held_since_ = 0.0;        // [s]
};

}  // namespace smartmill::sim
