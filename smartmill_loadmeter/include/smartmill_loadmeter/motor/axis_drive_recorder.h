#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/motor/axis_drive.h"

namespace smartmill::loadmeter {

struct AxisDriveRecorderOptions {
  double longest = 300.0;  ///< [s] of motion that is kept, 14 MB at 1 kHz; the oldest move is discarded
  double move = 10.0;      ///< [s] a longer motion becomes several moves, so that its begin can be discarded
  double rest = 0.2;       ///< [s] of rest of all axes that is kept before and after a motion
};

/// Collects the moves of the feed drives in air from a record of Servo Guide (daq/servo: axis_vx, axis_vy,
/// axis_vz [m/s], current_x, current_y, current_z [A]). Nothing is kept of a cut. Inputs in stamp order.
class AxisDriveRecorder {
 public:
  explicit AxisDriveRecorder(const AxisDriveRecorderOptions& options = {}) : options_(options) {}

  void handle(const CuttingCondition& condition);
  /// Lost samples separate two moves.
  void handle(const SampleBlock& servo);
  void reset() { *this = AxisDriveRecorder(options_); }

  double newest() const { return newest_; }  ///< [s] end of the last block; 0: none yet
  std::size_t moves() const { return moves_.size(); }
  double recorded() const;  ///< [s] of motion

  /// From all moves in which the axis moves. @param axis 0, 1, 2: x, y, z. @throws Error, as
  /// identifyAxisDrive, also if nothing was received or the record lacks a channel.
  AxisDrive identify(std::size_t axis, const AxisDriveOptions& options = {}) const;

 private:
  struct Move {
    double sample_rate = 0.0;
    std::array<std::vector<double>, 3> velocity, current;
    std::size_t size() const { return velocity[0].size(); }
  };
  void add(const std::array<double, 3>& velocity, const std::array<double, 3>& current, double sample_rate);

  AxisDriveRecorderOptions options_;
  std::deque<Move> moves_;
  bool cutting_ = false;
  bool open_ = false;     // the last move goes on
  double resting_ = 0.0;  // [s] of all axes
  bool lacks_channels_ = false;
  double newest_ = 0.0;
  std::optional<std::uint64_t> next_index_;
};

}  // namespace smartmill::loadmeter
