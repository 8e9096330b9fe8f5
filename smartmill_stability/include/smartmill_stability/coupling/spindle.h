#pragma once

#include <optional>
#include <vector>

#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_stability/coupling/beam.h"

namespace smartmill::stability {

/// Receptances of a structure at one point, over frequency.
struct SpindleReceptances {
  std::vector<double> frequency;  ///< [Hz] rising, > 0
  std::vector<Receptance> value;
};

/// A round bar of known dimensions in the spindle, which is tapped in place of holder and tool.
struct Gauge {
  std::vector<BeamSegment> segments;  ///< from the tapped end to the flange of the spindle
  double second_point = 0.0;          ///< [m] > 0 from the tapped end, within the first segment
  void validate() const;              ///< @throws Error naming the quantity
};

/// FRFs of the gauge in one direction [m/N], on common lines.
struct GaugeTaps {
  FrequencyResponse direct;  ///< at the end
  FrequencyResponse cross;   ///< displacement at the end for a force at the second point, or the reverse
  /// At the second point. Absent: the rotational receptances of the end follow from finite differences.
  std::optional<FrequencyResponse> second;
};

/// Receptances of the spindle at its flange, without the gauge.
///
/// With three FRFs: the compliance X = (R + S)^-1 at the flange, R the free gauge, S the spindle, is
/// symmetric and enters the FRF between any two points i, j of the gauge linearly, H_ij = r_ij - r_i X r_j;
/// three FRFs determine its three values at each line (inverse receptance coupling: Park, Altintas and
/// Movahhedy, Int. J. Mach. Tools Manuf. 43, 2003, here with three points on one gauge in place of several
/// gauges).
///
/// With two: N = (H_cross - H_direct) / distance, L = N, P = N^2 / H at the end (Schmitz and Duncan, J.
/// Manuf. Sci. Eng. 127, 2005), which neglects the bending between both points and, in P, all but one mode.
/// @throws Error on unequal lines, another unit than m/N, an invalid gauge.
SpindleReceptances spindleReceptances(const Gauge& gauge, const GaugeTaps& taps, double low, double high);

}  // namespace smartmill::stability
