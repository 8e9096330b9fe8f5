#pragma once

#include <array>
#include <optional>

#include "controller/axes_motion.h"
#include "controller/overrides.h"
#include "controller/path_planner.h"
#include "controller/spindle_control.h"
#include "controller/variables.h"

namespace smartmill::sim {

/// Executes one block after the other on axes and spindle. Times [s] are those of the caller's clock.
class BlockExecutor {
 public:
  /// The arguments must outlive the executor.
  BlockExecutor(const ControllerOptions& options, const Overrides& overrides, Variables& variables,
                AxesMotion& axes, SpindleControl& spindle);

  /// State of the modal words that a program begins with.
  void reset();
  /// Starts a block. @throws NcAlarm
  void start(double time, const NcBlock& block);
  /// The wait of the block is over: its next segment, its M word after the motion, or its end. @param now [s]
  /// of the variables @return the M word executed; -1: none @throws NcAlarm
  int proceed(double now, double time);
  /// Axes and spindle stop, the block is dropped.
  void halt(double time);

  bool running() const { return running_; }
  double waitUntil() const { return wait_until_; }  ///< [s] end of the running block's wait
  bool dwells(double now) const { return running_ && block_.dwell && now < wait_until_; }
  bool waitsForM() const { return running_ && block_.m_code; }
  int lastMCode() const { return last_m_; }
  int tool() const { return tool_; }  ///< T of the tool in the spindle

  /// Feed hold: the axes brake to rest on their path.
  void hold(double now);
  /// Resumes after a hold of a duration [s].
  void resume(double now, double duration);
  /// Applies changed overrides to the present motion.
  void updateFeed(double now);

  std::optional<double> readVariable(int number, double now) const;
  std::array<double, 3> workPosition(double now) const;  ///< [m]

 private:
  void writeVariable(int number, std::optional<double> value);
  void startSpindle(double time, const NcBlock& block);
  void planPath(const NcBlock& block);
  double feedOf(const AxesMotion::Segment& segment) const;
  void beginNextSegment(double time);
  void selectTool(int tool);

  const ControllerOptions& options_;
  const Overrides& overrides_;
  Variables& variables_;
  AxesMotion& axes_;
  SpindleControl& spindle_;
  NcModal modal_;
  NcBlock block_;  // the running or last one
  bool running_ = false;
  double wait_until_ = 0.0;  // [s]
  int last_m_ = 0;
  int selected_tool_ = 0, tool_ = 0;  // T words
  bool changing_ = false;             // the tool, at the end of the wait
};

}  // namespace smartmill::sim
