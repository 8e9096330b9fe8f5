#pragma once

#include <vector>

#include "smartmill_core/modal/modal_model.h"

namespace smartmill::kalman {

/// A mode of the sensor told from a cut alone, without a tap.
struct BlindMode {
  Mode mode;           ///< with standard deviations; gain is not told and stays NaN
  double above = 0.0;  ///< [1] peak of its spectral density over the floor beside it
  double likelihood =
      0.0;  ///< [1] rise of the log-likelihood over a flat spectrum; below 10 there is no mode
};

/// What does not repeat with the revolution (chips breaking, material) shakes the sensor at all frequencies:
/// between the lines of the spindle its spectrum shows the sensor's mode. Whittle likelihood of one resonance
/// on a floor in the band; the resonance may as well be the tool's or the workpiece's, and the record does
/// not say with which share it shows in the force.
/// @param samples [N] steady cut @param sample_rate [Hz] @param spindle_speed [rad/s] @param low, high [Hz]
/// @throws Error when too few lines stand between the spindle's.
BlindMode findBlindMode(const std::vector<double>& samples, double sample_rate, double spindle_speed,
                        double low, double high);

}  // namespace smartmill::kalman
