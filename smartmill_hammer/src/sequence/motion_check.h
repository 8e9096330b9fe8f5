#pragma once

#include "controller_state.h"
#include "smartmill_hammer/sequence/hammer_parameters.h"

namespace smartmill::hammer {

/// Decides from the streams when a commanded motion is complete: at its target and at rest.
class MotionCheck {
 public:
  explicit MotionCheck(const HammerParameters& parameters) : parameters_(parameters) {}

  void expectAngle(double angle);
  void expectPosition(const Axes3& position, double tolerance);
  void expectStandstill();

  /// To be called with each state after the command. Twice at the target completes the motion.
  bool isComplete(const CncState& state, const AxesPosition& axes);
  /// To be called with each angle after the command. `rest_readings` at the target complete the orientation.
  bool isComplete(const SpindleAngle& angle);

  const Axes3& position() const { return position_; }     ///< [m] commanded
  double angle() const { return angle_; }                 ///< [rad] commanded
  double reachedAngle() const { return reached_angle_; }  ///< [rad] mean after an orientation

 private:
  const HammerParameters& parameters_;
  Axes3 position_{{0, 0, 0}};
  bool checks_position_ = false;
  double tolerance_ = 0.0;                                       // [m]
  double angle_ = 0.0, offset_sum_ = 0.0, reached_angle_ = 0.0;  // [rad]
  int rest_count_ = 0;                                           // consecutive inputs at the target
};

}  // namespace smartmill::hammer
