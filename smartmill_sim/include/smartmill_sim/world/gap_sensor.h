#pragma once

#include <array>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/world/station_traits.h"

namespace smartmill::sim {

/// Distance of the tool's surface from its cutting circle, by teeth and flutes.
class ToolSurface {
 public:
  /// @param depth [m] of the flutes
  ToolSurface(const StationTraits& traits, const ToolGeometry& tool, double depth);

  /// Radial distance [m] from the cutting circle to the surface in the direction `facing` [rad, clockwise
  /// from +y] with the spindle at `angle` [rad], at a height [m] above the tip; edges lag by the helix.
  double retreat(double angle, double height, double facing) const;
  /// Offset [m] of the tool axis towards `facing` by eccentricity.
  double eccentricityTowards(double angle, double facing) const;
  double radius() const { return tool_.radius(); }

 private:
  double recess(double off) const;

  ToolGeometry tool_;
  double depth_;
  double rake_, relief_, land_;
  bool insert_;
  std::vector<double> tooth_distance_;
  double eccentricity_, eccentricity_angle_;
};

/// Capacitive displacement sensor: the capacitance of a disc electrode in front of the tool is the mean of 1
/// / gap over the disc, where the gap follows the tool's curvature, flutes and helix. The linearising
/// amplifier has the characteristic of a flat target, V = gain (g0 <1 / gap> - 1). The sensitivity therefore
/// depends on diameter and flutes (Dunwoody section 4.2).
class GapSensor {
 public:
  /// @param facing [rad] angle of a tooth that points at the sensor, clockwise from +y
  GapSensor(const StationTraits& traits, const smartmill::HammerStation& station, double facing);

  /// Sets the target of the sensor. @param angle [rad] of the spindle @param above [m] height of the sensor's
  /// centre above the tip @param lateral [m] lateral offset of the tool axis from the sensor axis, against
  /// the sense of the angle
  void setTarget(const ToolSurface& surface, double angle, double above, double lateral);

  /// Voltage [V], clipped, without noise. @param gap [m] from the sensor's face to the cutting circle
  double voltage(double gap) const;
  /// Least distance [m] of the tool from the sensor's face at a gap [m]; <= 0: contact.
  double clearance(double gap) const;
  double clipped(double voltage) const;

 private:
  struct Spot {
    double lateral, height, share;  // [m], [m], [1]; share 0: on the housing, not on the electrode
  };
  std::vector<Spot> spots_;
  std::vector<double>
      surface_distance_;  // [m] distance of the surface from the foremost line of the cutting circle, by spot
  double facing_, gain_, gap_, range_, nonlinearity_;
};

/// Mean voltage of a gap sensor over the integration steps of a sample. The values of the present target are
/// computed once for equal gaps.
class GapMean {
 public:
  /// @param contact_volt [V] while the tool touches the sensor
  GapMean(const GapSensor& sensor, double contact_volt) : sensor_(sensor), contact_volt_(contact_volt) {}

  const GapSensor& sensor() const { return sensor_; }
  /// As GapSensor::setTarget().
  void setTarget(const ToolSurface& surface, double angle, double above, double lateral);
  /// Adds a step. @param gap [m] from the sensor's face to the cutting circle @return [m] clearance
  double add(double gap);
  double sum() const { return sum_; }  ///< [V] over the steps
  void clear() { sum_ = 0.0; }

 private:
  GapSensor sensor_;
  double contact_volt_;
  double gap_ = -1.0, clearance_ = 1.0, volt_ = 0.0;  // [m], [m], [V] of the last step
  double sum_ = 0.0;
};

}  // namespace smartmill::sim
