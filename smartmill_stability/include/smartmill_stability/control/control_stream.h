#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "smartmill_core/signal/streams.h"
#include "smartmill_stability/control/turning_control.h"

namespace smartmill::stability {

struct ControlStreamParameters {
  std::string deflection_channel = "deflection";
  std::string tool_channel = "tool";
  double integrator_corner = 2.0;
  double speed_tolerance = 1.0e-3;
  ControllerParameters controller;  ///< rate and period are taken from the streams

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of chatter_control_node (turning). Input topics: daq/displacement (SampleBlock with the "
        "two channels below) and spindle/angle.");
    table.section();
    table.text("deflection_channel", deflection_channel,
               "channel with the deflection of machine and workpiece [m] or its acceleration [m/s2]");
    table.text("tool_channel", tool_channel, "channel with the displacement of the actuator [m]");
    table.number("integrator_corner", integrator_corner, "Hz", Range::positive(),
                 "corner frequency of the integration of an acceleration");
    table.number("speed_tolerance", speed_tolerance, "1", Range::positive(),
                 "relative change of the spindle speed above which the identification restarts");
    controller.declare(table);
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// State of the identification after one segment.
struct LearntMachine {
  double stamp = 0.0;  ///< [s] last sample of the segment
  SecondOrder machine;
  SecondOrder controller;  ///< active from here on; gain 0: none
  bool informed = false;   ///< whether the segment contributed to the estimate
};

/// Adaptive chatter control on the displacement streams of a lathe, for node and replay: sample blocks in,
/// command blocks out. A gap in the samples, a jump back in time, a new sample rate or a new spindle speed
/// restarts it.
class ControlStream {
 public:
  using Learnt = std::function<void(const LearntMachine&)>;
  /// @throws Error on bad parameters.
  ControlStream(const ControlStreamParameters& parameters, Learnt learnt);

  void handle(const SpindleAngle& angle);
  /// @return commands for the samples of the block, one channel "command" [m]; empty before the spindle speed
  /// is known. @throws Error on a missing channel or a unit that is neither m nor m/s2.
  std::optional<SampleBlock> handle(const SampleBlock& block);

 private:
  ControlStreamParameters parameters_;
  Learnt learnt_;
  std::optional<AdaptiveChatterController> controller_;
  std::optional<AccelerationIntegrator> integrator_;
  double speed_ = 0.0, rate_ = 0.0, last_stamp_ = 0.0;
  std::uint64_t next_index_ = 0;
};

}  // namespace smartmill::stability
