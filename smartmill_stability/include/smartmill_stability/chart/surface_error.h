#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/chart/uncertainty.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Chip geometry of a finishing cut with a machine: feed per tooth [m], edge forces and runout of the model.
/// @throws Error when the model lacks the edge coefficients kte and kre.
ChipGeometry finishingChip(const MachineModel& model, double feed);

/// The wall that a stable peripheral cut leaves. A tooth generates it where it passes the surface: at
/// immersion angle 0 when up-milling (entry 0), at pi when down-milling (exit pi). With the vibration u of
/// the tool at that instant and n the direction from the tool's axis into the part, the tooth leaves the wall
/// at n.u: positive is overcut (the wall lies inside the part, material is missing), negative undercut
/// (Schmitz and Smith, Machining Dynamics, 2019, ch. 5; Schmitz and Mann, Int. J. Mach. Tools Manuf. 46,
/// 2006).
struct MachinedWall {
  /// [m] Surface location error: mean line of the wall along the feed relative to that of a rigid tool
  /// without runout; over the height of the cut the value of the largest magnitude.
  double error = 0.0;
  double least = 0.0,
         most = 0.0;  ///< [m] of the same over the height: a helix generates it at different times
  /// [m] Peak to valley and mean deviation along the feed at the height where they are largest: feed marks,
  /// with unequal teeth the waviness of a revolution.
  double peak_to_valley = 0.0, mean_deviation = 0.0;
};

/// @throws Error unless an engagement generates one wall: entry 0 or exit pi [rad]. @return whether it is
/// down-milling
bool requireOneWall(double entry, double exit);

/// The wall from the steady vibration of a stable cut. In a stable cut with alike teeth the regeneration
/// cancels (u repeats with the tooth period), and the vibration is the response of the modes to the Fourier
/// series of the force of a rigid tool; with unequal teeth it is the forced vibration with the contact of the
/// teeth. The vibration is that of the tip at all heights; it moves the arc of the next tooth by its own size
/// only: the error has to be small compared with the radial depth.
class WallPrediction {
 public:
  /// @param system milling with modes and a chip geometry. @throws Error on an invalid system and on an
  /// engagement that generates no wall or two.
  explicit WallPrediction(const RegenerativeSystem& system);

  /// @param speed [rad/s] > 0 @param depth [m] > 0
  MachinedWall at(double speed, double depth) const;
  /// [m] [tooth][height]: how far each tooth reaches into the part where it generates the wall at heights [m]
  /// above the tip, with its own radius; one entry for alike teeth.
  std::vector<std::vector<double>> offsets(double speed, double depth,
                                           const std::vector<double>& heights) const;
  bool alike() const { return alike_; }  ///< whether all teeth have the same chip

 private:
  std::vector<double> alikeOffsets(double speed, double depth, const std::vector<double>& heights) const;
  std::vector<double> heightsOf(double depth) const;

  RegenerativeSystem system_;
  bool alike_, down_;
  double lag_ = 0.0;                 // [rad/m]
  std::vector<double> tooth_angle_;  // [rad]
};

/// [m] Standard deviation of the surface location error over drawn machines.
double errorStd(const std::vector<WallPrediction>& drawn, double speed, double depth);

/// Walls over speeds and depths with standard deviations.
struct SurfaceMap {
  std::vector<double> speeds;  ///< [rad/s] ascending
  std::vector<double> depths;  ///< [m] ascending
  std::vector<double> limit;   ///< [m] of stability at each speed; +inf: stable to the largest depth
  /// [m] Depth that chatters on at most the accepted share of the drawn machines at any speed within the
  /// margin.
  std::vector<double> at_risk;
  std::vector<std::vector<MachinedWall>> wall;  ///< [speed][depth], meaningless in an unstable cut
  /// [m] Of the surface location error, from the standard deviations of modes and coefficients. With unequal
  /// teeth that of the same tool with alike ones.
  std::vector<std::vector<double>> error_std;
  bool stable(std::size_t speed, std::size_t depth) const { return depths[depth] < limit[speed]; }
};

struct SurfaceMapOptions {
  int draws = 40;  ///< machines, >= 2
  unsigned seed = 1;
  double risk = 0.05;          ///< [1] largest probability of chatter
  double speed_margin = 0.01;  ///< [1] relative error of the speed on both sides
};

/// @param system with a chip geometry. @param progress called with the completed share.
/// @throws Error on empty axes, and as WallPrediction.
SurfaceMap surfaceMap(const UncertainSystem& system, const std::vector<double>& speeds,
                      const std::vector<double>& depths, const SurfaceMapOptions& options = {},
                      const std::function<void(double)>& progress = {});

/// A finishing cut that is stable and makes size.
struct FinishingCut {
  double speed = 0.0;  ///< [rad/s]
  double depth = 0.0;  ///< [m]
  MachinedWall wall;
  double error_std = 0.0;    ///< [m]
  double worst_error = 0.0;  ///< [m] largest |error| + 2 standard deviations within the speed margin
};

/// Cuts whose probability of chatter is at most the risk, which lie a margin below the limit, and whose
/// |error| + 2 standard deviations stays within the tolerance, all within the speed margin: the largest speed
/// x depth, one for each pocket (5 % of speed), best first.
/// @param tolerance [m] > 0 of the wall on either side @param depth_margin [1] below the limit
std::vector<FinishingCut> finishingCuts(const SurfaceMap& map, double tolerance, double speed_margin,
                                        double depth_margin, int count);

}  // namespace smartmill::stability
