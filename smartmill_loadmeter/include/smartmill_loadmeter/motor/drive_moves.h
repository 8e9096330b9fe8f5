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

struct DriveMoveOptions {
  double rest_tolerance = 2e-6;       ///< [m] largest change between states at rest
  double before = 0.08, after = 0.1;  ///< [s] of current before and after a move
  double stored = 6.0;                ///< [s] of current
  double largest_gap = 0.1;           ///< [s] between states
  double duration_tolerance = 0.06;   ///< [s] largest difference of a duration from that of a rapid move
  std::size_t most_moves = 12;        ///< of an axis that are evaluated
};

/// Finds rapid moves in the controller states and identifies each drive's lag from them. Inputs in stamp
/// order.
class DriveMoves {
 public:
  /// @param axes acceleration and rapid traverse of the model; empty: moves are not evaluated
  DriveMoves(const MotorParameters& parameters, const std::optional<MachineAxes>& axes,
             const DriveMoveOptions& options = {});

  void handle(const CncState& state);
  /// Channels x, y, z of daq/motor_current.
  void handle(const SampleBlock& block);
  void clear();

  /// Bandwidth [Hz] from the moves so far; empty: none.
  const std::optional<Estimate>& bandwidth(std::size_t axis) const { return axes_[axis].bandwidth; }

 private:
  struct Move {
    double begin = 0.0, end = 0.0, distance = 0.0;  // [s], [s], [m]
  };
  struct Axis {
    double position = 0.0, from = 0.0;  // [m] at present, at the start of the move
    bool moving = false;
    double begin = 0.0;  // [s] last state at rest
    std::vector<Move> waiting;
    std::vector<Estimate> bandwidths;
    std::optional<Estimate> bandwidth;
  };
  void evaluateWaiting();
  void identifyMove(std::size_t axis, const Move& move);

  MotorParameters parameters_;
  DriveMoveOptions options_;
  std::optional<MachineAxes> limits_;
  std::array<Axis, 3> axes_;
  std::array<Move, 3> last_;  // last finished move of each axis, rapid or not
  double last_state_ = 0.0;
  std::array<std::deque<double>, 3> samples_;  // [A]
  double rate_ = 0.0, start_ = 0.0;            // [Hz], [s] of the first stored sample
  std::uint64_t next_ = 0;
};

}  // namespace smartmill::loadmeter
