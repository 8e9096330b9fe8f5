#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_core/modal/modal_model.h"

namespace smartmill::kalman {

/// A mode of the sensor estimated from a cut, without a tap.
struct BlindMode {
  Mode mode;                ///< with standard deviations; the gain is unknown: NaN
  double above = 0.0;       ///< [1] peak of its spectral density over the noise floor
  double likelihood = 0.0;  ///< [1] gain in log-likelihood over a flat spectrum; below 10: no mode
};

struct BlindModeOptions {
  double skirt = 4.0;  ///< lines on each side of a harmonic that are omitted: main lobe of the Hann window,
                       ///< and error of the speed
  std::size_t min_lines = 50;  ///< between the harmonics, for four unknowns of a scattered spectrum
};

/// The part of the cutting force that is not synchronous with the spindle (chip breakage, material) excites
/// the sensor at all frequencies, so that its modes appear between the harmonics of the spindle. Fits one
/// resonance on a noise floor in the band by its Whittle likelihood. The resonance may also belong to the
/// tool or the workpiece, and its gain in the measured force is not identifiable.
/// @param samples [N] steady cut @param sample_rate [Hz] @param spindle_speed [rad/s] @param low, high [Hz]
/// @throws Error when there are too few lines between the harmonics.
BlindMode findBlindMode(const std::vector<double>& samples, double sample_rate, double spindle_speed,
                        double low, double high, const BlindModeOptions& options = {});

}  // namespace smartmill::kalman
