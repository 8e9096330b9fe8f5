#pragma once

#include <array>
#include <cstdint>

#include "smartmill_core/signal/streams.h"
#include "smartmill_sim/controller/axis_drive.h"
#include "smartmill_sim/controller/motion_state.h"

namespace smartmill::sim {

/// Record of Fanuc's Servo Guide: spindle load, motor currents and velocities of the axes at 1 kHz, the
/// running block, and a trigger at the start of a block (N word).
class ServoRecorder {
 public:
  static constexpr double SAMPLE_RATE = 1000.0;  ///< [Hz]

  /// @param trigger N word of the block whose start sets the channel trigger; 0: none
  explicit ServoRecorder(int trigger, const std::array<AxisDrive, 3>& drives = {})
      : drives_(drives), trigger_(trigger) {}

  struct Input {
    double time = 0.0;  ///< [s]
    MotionState motion;
    double spindle_load = 0.0;               ///< [1] of full scale, unrounded
    std::array<double, 3> force{{0, 0, 0}};  ///< [N] cutting force on the tool
  };
  /// Inputs at a rate of at least SAMPLE_RATE; each sample is the first input at or after its time.
  void push(const Input& input);

  /// Samples since the last call: channels spindle_load [1], current_x, current_y, current_z [A], axis_vx,
  /// axis_vy, axis_vz [m/s], sequence [1], trigger [1].
  SampleBlock take();
  const std::array<double, 3>& current() const { return current_; }  ///< [A] latest
  std::array<double, 3> load() const;                                ///< [percent] of the axes

 private:
  std::array<AxisDrive, 3> drives_;
  int trigger_;
  bool triggered_ = false, started_ = false;
  std::uint64_t index_ = 0, block_index_ = 0;
  double last_time_ = 0.0;
  std::array<double, 3> last_velocity_{{0, 0, 0}}, current_{{0, 0, 0}}, cut_{{0, 0, 0}};
  std::uint64_t cut_count_ = 0;
  int sequence_ = 0;
  std::vector<double> samples_;
};

}  // namespace smartmill::sim
