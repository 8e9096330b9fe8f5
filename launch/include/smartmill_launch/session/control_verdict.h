#pragma once

#include <string>
#include <vector>

#include "smartmill_launch/session/session_plan.h"

namespace smartmill::session {

/// State of the controller during a cut under chatter control.
struct CutState {
  double stamp = 0.0;          ///< [s]
  double spindle_speed = 0.0;  ///< [rad/s] actual
  double feed = 0.0;           ///< [m/s] actual, along the path
};

/// What the chatter control did in a cut that it was to stabilise.
struct ControlVerdict {
  double onset = NOT_A_NUMBER;      ///< [s] end of the first chattering window; NaN: no chatter
  double frequency = NOT_A_NUMBER;  ///< [Hz] of the chatter before the control acted, median
  double duration = NOT_A_NUMBER;   ///< [s] from the onset to the last change of speed or feed; NaN: none
  double speed_ratio = 1.0, feed_ratio = 1.0;  ///< [1] at the end of the cut, of the programmed values
  CutVerdict after;                            ///< of the windows after the last change

  bool suppressed() const;  ///< it chattered, the control acted, and the cut was stable afterwards
  std::string text() const;
};

/// @param windows of the cut, in order. @param states of its steady part, in order. @param speed [rad/s]
/// and @param feed [m/s] as programmed
ControlVerdict controlVerdict(const std::vector<ChatterWindow>& windows, const std::vector<CutState>& states,
                              double speed, double feed);

}  // namespace smartmill::session
