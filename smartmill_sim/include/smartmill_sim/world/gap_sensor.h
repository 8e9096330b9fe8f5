#pragma once

#include <array>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/world/station_traits.h"

namespace smartmill::sim {

/// How far the tool's surface stands behind its cutting circle, by the teeth.
class ToolSurface {
 public:
  /// @param depth [m] between two flutes
  ToolSurface(const StationTraits& traits, const ToolGeometry& tool, double depth);

  /// [m] in the direction `facing` [rad, clockwise from +y], spindle at `angle`, at a height above the tip:
  /// edges lag by the helix.
  double retreat(double angle, double height, double facing) const;
  /// [m] by which the tool's axis stands off towards `facing`.
  double throwTo(double angle, double facing) const;
  double radius() const { return tool_.radius(); }

 private:
  double behind(double off) const;

  ToolGeometry tool_;
  double depth_;
  double rake_, relief_, land_;
  bool insert_;
  std::vector<double> low_;
  double eccentricity_, eccentricity_angle_;
};

/// Capacitive displacement sensor: the capacity of a disc electrode before the tool, 1 / gap averaged over
/// the disc, the gap opening with the tool's roundness, its flutes and its helix; a linearising amplifier
/// whose curve is that of a flat target, V = gain (g0 <1 / gap> - 1). So the sensitivity depends on diameter
/// and flute (Dunwoody section 4.2).
class GapSensor {
 public:
  /// @param facing [rad] of a tooth that points at the sensor, clockwise from +y
  GapSensor(const StationTraits& traits, const smartmill::HammerStation& station, double facing);

  /// The tool at rest or in motion before the sensor: from now on the voltage is of this surface.
  /// @param above [m] height of the sensor's centre above the tip @param beside [m] of the tool's axis off
  /// the sensor's, against the sense of the angle
  void face(const ToolSurface& surface, double angle, double above, double beside);

  /// [V], clipped, without noise. @param gap [m] from the sensor's face to the cutting circle
  double voltage(double gap) const;
  /// [m] least distance of the tool from the sensor's face at that gap; <= 0: contact.
  double clearance(double gap) const;
  double clipped(double voltage) const;

 private:
  struct Spot {
    double lateral, height, share;  // [m], [m], [1]; share 0: of the housing alone
  };
  std::vector<Spot> spots_;
  std::vector<double> behind_;  // [m] of the surface behind the cutting circle's foremost line, by spot
  double facing_, gain_, gap_, range_, bend_;
};

}  // namespace smartmill::sim
