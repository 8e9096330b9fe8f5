#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/modal/modal_model.h"

namespace smartmill {

/// The reference cut of the project's figures: slot, D 16 mm, 4 flutes, helix 30 deg, 2 mm deep, 0.06 mm per
/// tooth, Ktc 800, Krc 250 N/mm2, Kte = Kre = 20 N/mm, runout 8 um; sensor modes 1450, 2300, 3600 Hz on each
/// axis; 1 N of noise; 25.6 kHz.
struct ReferenceCase {
  double spindle_speed = 0.0;    ///< [rad/s]
  double duration = 1.0;         ///< [s]
  double engage_time = 0.02;     ///< [s] the tool is in the cut from here
  double noise_rms = 1.0;        ///< [N]
  double sample_rate = 25600.0;  ///< [Hz]
  double speed_drop = 0.0;       ///< [1] relative drop of the speed under load ...
  double drop_time = 0.3;        ///< [s] ... with this time constant
  double speed_ripple = 0.0;     ///< [1] RMS of a sine on the speed over the speed ...
  double ripple_frequency =
      0.0;                   ///< [Hz] ... > 0 with speed_ripple; a multiple of the spindle's is synchronous
  double nominal_off = 0.0;  ///< [1] relative error of the speed of the cutting condition
  std::uint32_t seed = 1;
  ModalModel sensor = exactSensor();  ///< at the start
  ModalModel later = exactSensor();   ///< at the end
  double drift_from = 1e9,
         drift_to = 1e9;  ///< [s] over which the sensor's parameters change from one to the other

  double speedAt(double time) const;  ///< [rad/s]
  double angleAt(double time) const;  ///< [rad] of the spindle, zero at time zero, not wrapped

  static ToolGeometry tool();
  static Engagement slot();
  static ModalModel exactSensor();
};

struct ReferenceRecord {
  std::vector<double> time;                     ///< [s]
  std::array<std::vector<double>, 2> truth;     ///< [N] applied, x and y
  std::array<std::vector<double>, 2> measured;  ///< [N]
};

/// The sensor is simulated at eight times the sample rate, exact for a force that is linear between those
/// samples.
ReferenceRecord simulate(const ReferenceCase& reference);

/// Hammer taps: sin^2 pulses of 0.2 ms and 500 N, one record of 0.2 s per tap.
struct ReferenceTaps {
  std::vector<std::vector<double>> hammer, response;  ///< [N]
};
ReferenceTaps simulateTaps(const ReferenceCase& reference, int taps);

/// Norm of the difference of the spectra over the norm of the true spectrum, 0 Hz up to the band limit, Hann
/// window.
/// @param from, to samples @param band [Hz]
double bandError(const std::vector<double>& estimate, const std::vector<double>& truth, double sample_rate,
                 std::size_t from, std::size_t to, double band);

}  // namespace smartmill
