#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/modal/modal_model.h"

namespace smartmill {

/// The reference cut of the project's figures: slot, D 16 mm, 4 flutes, helix 30 deg, 2 mm deep, 0.06 mm a
/// tooth, Ktc 800, Krc 250 N/mm2, Kte = Kre = 20 N/mm, runout 8 um; sensor modes 1450, 2300, 3600 Hz on each
/// axis; 1 N of noise; 25.6 kHz.
struct ReferenceCase {
  double spindle_speed = 0.0;    ///< [rad/s]
  double duration = 1.0;         ///< [s]
  double engage_time = 0.02;     ///< [s] the tool is in the cut from here
  double noise_rms = 1.0;        ///< [N]
  double sample_rate = 25600.0;  ///< [Hz]
  double speed_drop = 0.0;       ///< [1] share of speed that the cut's load takes ...
  double drop_time = 0.3;        ///< [s] ... with this time constant
  double nominal_off = 0.0;      ///< [1] share by which the cutting condition's speed is off
  std::uint32_t seed = 1;
  ModalModel sensor = exactSensor();  ///< that measures
  ModalModel later = exactSensor();   ///< that measures at the end
  double drift_from = 1e9,
         drift_to = 1e9;  ///< [s] between them the sensor's parameters go from the one to the other

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

/// The sensor runs at eight times the sample rate, exactly for a force linear between those samples.
ReferenceRecord simulate(const ReferenceCase& reference);

/// Taps with a hammer: sin^2 blows of 0.2 ms and 500 N, one record a tap of 0.2 s.
struct ReferenceTaps {
  std::vector<std::vector<double>> hammer, response;  ///< [N]
};
ReferenceTaps simulateTaps(const ReferenceCase& reference, int taps);

/// Norm of the difference of the spectra over the norm of the truth's, 0 Hz up to the band limit, Hann
/// window.
/// @param from, to samples @param band [Hz]
double bandError(const std::vector<double>& estimate, const std::vector<double>& truth, double sample_rate,
                 std::size_t from, std::size_t to, double band);

}  // namespace smartmill
