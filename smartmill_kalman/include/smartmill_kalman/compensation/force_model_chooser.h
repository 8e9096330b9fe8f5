#pragma once

#include <limits>
#include <string>

#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/compensation/compensation_parameters.h"
#include "smartmill_kalman/compensation/speed_ripple.h"

namespace smartmill::kalman {

/// Source of the spindle speed that the filters use, and the reason.
struct ForceModelChoice {
  enum class Speed {
    measured,   ///< spindle/angle
    estimated,  ///< a state of the filter
    unknown     ///< samples pass through
  };
  enum class Reason {
    none,
    parameter,  ///< track_speed always
    no_angle,   ///< since value [s]; infinite: there was none
    ripple      ///< value [1]: RMS over the speed
  };
  Speed speed = Speed::measured;
  Reason reason = Reason::none;
  double value = 0.0;
};

/// Chooses whether the speed is measured or a state of the filter (HarmonicSpeedTracker), for each block of
/// the force sensor. With track_speed auto the speed is estimated where spindle/angle is missing for longer
/// than angle_timeout and where it ripples. Readings that return are used once they have come for
/// angle_timeout. Inputs in stamp order; the choice depends on stamps and readings only.
class ForceModelChooser {
 public:
  explicit ForceModelChooser(const CompensationParameters& parameters);

  void handle(const SpindleAngle& angle);
  void handle(const CuttingCondition& condition) { commanded_ = condition.spindle_speed; }
  void handle(const CncState& state);
  /// @param stamp [s] of a block
  const ForceModelChoice& choose(double stamp);

  /// [rad/s] from which an estimate starts: mean of rippling readings, controller state, or cutting
  /// condition; 0: unknown
  double startSpeed() const;
  /// [rad/s] actual speed of a controller state that is at most angle_timeout old; NaN: none
  double controllerSpeed() const;
  /// One line for the diagnostics.
  std::string text() const;
  /// The speed of the last block is measured, and there is no reason for another choice.
  bool hasDefault() const { return choice_.reason == ForceModelChoice::Reason::none; }
  void reset();

 private:
  static constexpr double NEVER = -std::numeric_limits<double>::infinity();

  void estimate(ForceModelChoice::Reason reason, double value);

  AutoSetting setting_;
  std::string model_, obstacle_;  // name of the force model; what forbids an estimate
  double timeout_;                // [s]
  SpeedRipple ripple_;
  double block_ = NEVER, blocks_since_ = NEVER;  // [s] last block, first one after a gap
  double angle_ = NEVER, angles_since_ = NEVER;  // [s] last reading, first one after a gap
  bool was_missing_ = false;                     // readings, until they have returned
  double controller_stamp_ = NEVER;              // [s]
  double controller_ = 0.0, commanded_ = 0.0;    // [rad/s]
  ForceModelChoice choice_;
};

}  // namespace smartmill::kalman
