#pragma once

#include <cstddef>
#include <string>

#include "controller/block_buffer.h"
#include "controller/block_executor.h"

namespace smartmill::sim {

/// Runs a program: takes its blocks from the text, holds, stops and ends. Times [s] are those of the caller's
/// clock.
class ProgramRunner {
 public:
  /// The executor must outlive the runner. @param buffer_size [byte]
  ProgramRunner(BlockExecutor& executor, std::size_t buffer_size)
      : executor_(executor), buffer_size_(buffer_size) {}

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

  bool fromMemory() const { return from_memory_; }
  bool busy() const { return executor_.running() || buffer_.hasLine(); }
  bool held() const { return held_; }
  bool stopped() const { return stopped_; }  ///< M0

  /// Indicated state.
  struct Indicated {
    int program = 0, sequence = 0, blocks = 0;
    std::string block;
  };
  const Indicated& indicated() const { return indicated_; }
  std::string text() const;  ///< the block and the text that follows

 private:
  bool takeBlock();
  void finishWait();

  BlockExecutor& executor_;
  std::size_t buffer_size_;
  BlockBuffer buffer_;
  Indicated indicated_;
  int number_ = 0;  // of the program, as it began
  bool from_memory_ = false, held_ = false, stopped_ = false;
  double now_ = 0.0, time_ = 0.0;  // [s] present time, time of the block
  double held_since_ = 0.0;        // [s]
};

}  // namespace smartmill::sim
