#pragma once

#include <array>
#include <deque>
#include <optional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/motor/drive_response.h"
#include "smartmill_loadmeter/motor/motor_chain.h"

namespace smartmill::loadmeter {

/// Finds the moves in rapid traverse among whatever the machine does, and what they say of each drive's lag.
/// Fed in stamp order.
class DriveMoves {
 public:
  /// @param axes of the model: their acceleration and rapid traverse; empty: no moves are looked for
  DriveMoves(const MotorParameters& parameters, const std::optional<MachineAxes>& axes);

  void handle(const CncState& state);
  /// Channels x, y, z of daq/motor_current.
  void handle(const SampleBlock& block);
  void clear();

  /// [Hz] by the moves so far; empty: none yet.
  const std::optional<Estimate>& bandwidth(std::size_t axis) const { return axes_[axis].bandwidth; }
  int moves(std::size_t axis) const { return static_cast<int>(axes_[axis].bandwidths.size()); }

 private:
  struct Move {
    double begin = 0.0, end = 0.0, distance = 0.0;  // [s], [s], [m]
  };
  struct Axis {
    double position = 0.0, from = 0.0;  // [m] now, and where the move began
    bool moving = false;
    double begin = 0.0;  // [s] last state at rest
    std::vector<Move> waiting;
    std::vector<Estimate> bandwidths;
    std::optional<Estimate> bandwidth;
  };
  void rested(Axis& axis, double stamp);
  void look();
  void judge(std::size_t axis, const Move& move);

  MotorParameters parameters_;
  std::optional<MachineAxes> limits_;
  std::array<Axis, 3> axes_;
  std::array<Move, 3> last_;  // moves that ended, whether in rapid traverse or not
  double last_state_ = 0.0;
  std::array<std::deque<double>, 3> samples_;  // [A]
  double rate_ = 0.0, start_ = 0.0;            // [Hz], [s] of the first sample kept
  std::uint64_t next_ = 0;
};

}  // namespace smartmill::loadmeter
