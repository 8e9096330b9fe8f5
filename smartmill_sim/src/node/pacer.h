#pragma once

#include <atomic>

namespace smartmill::sim {

/// Pace of a simulation that runs in blocks of equal duration. Without a clock of its own, simulated time is
/// wall time. With it (/use_sim_time) simulated time follows wall time at a given pace, and a late simulation
/// holds the clock back: in a burst of blocks, what reads the controller would stamp its states too late.
/// Times are arguments; only heldBack() may be called from another thread.
class Pacer {
 public:
  /// @param wall [s] wall time of sample 0. @param block [s] > 0, duration of a block
  /// @param own_clock /use_sim_time. @param pace [1] > 0, simulated time per wall time, used with own_clock
  Pacer(double wall, double block, bool own_clock, double pace = 1.0)
      : start_(wall), block_(block), own_clock_(own_clock), pace_(own_clock ? pace : 1.0) {}

  double start() const { return start_; }         ///< [s] stamp of sample 0
  double done() const { return done_; }           ///< [s] simulated since the start
  double now() const { return start_ + done_; }   ///< [s] stamp of the end of the simulated samples
  double heldBack() const { return held_back_; }  ///< [s] by which the clock is behind the wall clock

  /// [s] by which the simulation is behind the clock at a wall time; holds its own clock back to one block.
  double behind(double wall) {
    const double late = pace_ * (wall - start_) - held_back_ - done_;
    if (!own_clock_ || late <= 2.0 * block_) return late;
    held_back_ = held_back_ + (late - block_);
    return block_;
  }
  /// [s] of wall time until the next block is complete; not positive: it is to be simulated now.
  double wait(double wall) { return (block_ - behind(wall)) / pace_; }
  /// Blocks that have been simulated or skipped.
  void proceed(double blocks = 1.0) { done_ += blocks * block_; }

 private:
  double start_, block_;
  bool own_clock_;
  double pace_;
  double done_ = 0.0;
  std::atomic<double> held_back_{0.0};
};

}  // namespace smartmill::sim
