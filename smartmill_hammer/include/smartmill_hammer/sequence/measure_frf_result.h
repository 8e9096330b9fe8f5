#pragma once

#include <string>

#include "smartmill_core/modal/results.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::hammer {

struct MeasureFrfResult {
  FrfCode code = FrfCode::ok;
  std::string message;
  MeasuredFrf frf;
  MeasuredModes modes;
  /// Before the per-mode correction to the tip; with eq. 4.44 or without a correction, as above.
  FrequencyResponse measured_frf;  ///< deviations without that of the sensitivity
  ModalModel measured;
  double sensitivity = NOT_A_NUMBER;       ///< [m/V] displacement towards the sensor per volt
  double sensitivity_std = NOT_A_NUMBER;   ///< [m/V]
  double flute_low = NOT_A_NUMBER;         ///< [rad] spindle angle with a flute at the sensor, at the tip
  double flute_high = NOT_A_NUMBER;        ///< [rad] halfway up to the hammer
  double flute_hammer = NOT_A_NUMBER;      ///< [rad] a flute at the hammer (eq. 4.1)
  double flute_confidence = NOT_A_NUMBER;  ///< [1] probability, by noise, that both searches bracket a flute
  int spindle_moves = 0;                   ///< [1] orientations of the spindle
  /// Struck along the direction, measured at right angles to it; direction "xy" or "yx". Empty: no second
  /// sensor, or the message states why.
  MeasuredFrf cross;
};

struct Feedback {
  std::string stage;
  double progress = 0.0;  ///< [1]
  int hits_done = 0;
};

}  // namespace smartmill::hammer
