#pragma once

#include <complex>
#include <cstdint>
#include <vector>

#include "smartmill_sim/turning/lathe.h"
#include "smartmill_stability/control/control_stream.h"

namespace smartmill::stability {

/// The simulated lathe with the control of the product, block by block as between the nodes, without wall
/// time.
struct TurningLoop {
  sim::LatheTraits lathe;
  ControlStreamParameters control;
  bool controlled = true;
  std::size_t block = 50;   ///< samples published together
  std::size_t way = 2;      ///< delay of a command in blocks: transport and computing
  double duration = 6.144;  ///< [s]
};

struct TurningTrace {
  std::vector<double> time, motion, deflection, force;  ///< [s], [m], [m], [N]
  std::vector<LearntMachine> learnt;
  std::uint64_t late = 0;  ///< commands that arrived after their sample

  /// Root mean square of the motion about its mean [m], from begin to end [s].
  double vibration(double begin, double end) const;
};
/// @throws Error on wrong parameters.
TurningTrace runTurning(const TurningLoop& loop);

/// Kim's machine (K/K_m 0.1, damping 0.02, 350 rad/s) at a speed at which the free vibration grows by
/// exp(logarithm) per segment of 2.048 s, with the lead that compensates the delay of the blocks.
TurningLoop kimLoop(double logarithm);

/// Kim's update, eq. 16, from the end of the second segment on, line by line:
/// G_j = G_j-1 + numerator / (Y_t,j-1 - Y_t,j-2) (G_j-1 - G_j-2), and the second-order system from its peak
/// and half-power width, as he states.
enum class KimUpdate {
  /// As printed: numerator Y_w,j-1 - Y_t,j-2, the spectra of the motions themselves (eq. 12), the estimates
  /// one
  /// after the other.
  printed,
  /// The secant of Y_w - Y_t that he derives it from (eq. 11): numerator Y_w,j-1 - Y_t,j-1, motions over the
  /// chip of their segment, each with the G in force in that segment (0 in the first).
  corrected
};
const char* nameOf(KimUpdate update);

/// One line of the spectra of a segment: Y_w, Y_t and the G that eq. 16 pairs with them.
struct KimLine {
  std::complex<double> work, tool, g;
};
/// Eq. 16 of one line; g of the last segment if the tool has moved alike in both.
std::complex<double> updateLine(KimUpdate update, const KimLine& last, const KimLine& before);

/// The estimates of the first two segments are the plain ratio of the spectra of deflection and chip.
struct KimSegment {
  std::vector<double> frequency;                  ///< [rad/s]
  std::vector<std::complex<double>> ratio, used;  ///< measured Y_w / chip; G after the update
  SecondOrder read;                               ///< off `used`
};
struct KimRun {
  std::vector<KimSegment> segments;
  TurningTrace trace;
};
/// The same lathe with Kim's controller, which gets every sample without delay (block and way are not used).
KimRun runKim(const TurningLoop& loop, KimUpdate update);

/// Peak and half-power width of a receptance about its largest line between two frequencies [rad/s].
SecondOrder readOff(const std::vector<double>& frequency, const std::vector<std::complex<double>>& response,
                    double low, double high);

}  // namespace smartmill::stability
