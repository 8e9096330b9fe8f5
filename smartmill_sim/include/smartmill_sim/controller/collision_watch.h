#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/model/station_axes.h"
#include "smartmill_sim/controller/motion_watch.h"

namespace smartmill::sim {

/// Sizes of sensor and hammer as in Dunwoody fig. 4.1: a probe of 10 mm and a solenoid of 20 mm, 60 mm long.
struct CollisionOptions {
  double sensor_half_width = 5e-3;   ///< [m]
  double sensor_above_tip = 5e-3;    ///< [m] of the upper side of the sensor
  double hammer_half_width = 10e-3;  ///< [m]
  double plunger = 3e-3;             ///< [m] stroke, by which the hammer at rest is behind the sensor's face
  double body_length = 60e-3;        ///< [m] of both, away from the tool
  double face_gaps = 2.0;  ///< [1] of the gap at zero volt, at which the sensor faces a tool at the station
};

/// Obstacles on the table as boxes along the axes of the hammer station. The tool is a cylinder whose tip
/// has its centre at the machine position.
class CollisionWatch : public MotionWatch {
 public:
  struct Body {
    std::string name;                       ///< as named in the alarm
    Axes3 low{{0, 0, 0}}, high{{0, 0, 0}};  ///< [m] along the axes of the hammer station
  };

  /// No obstacles.
  CollisionWatch() = default;
  /// Obstacles of a model: sensor and hammer of each direction of its hammer station, and the table under its
  /// workpiece. None without a tool or without these sections.
  static CollisionWatch ofModel(const MachineModel& model, const CollisionOptions& options = {});

  void add(const Body& body) { bodies_.push_back(body); }
  /// External alarm with the name of the body that the tool intersects.
  std::optional<focas::AlarmMessage> check(const MotionState& state) const override;

  /// The body that the tool intersects at a position [m]; nullptr: none. A tool at rest may face the body
  /// with the space between two flutes, so that only its core counts. @param turning whether the spindle
  /// turns
  const Body* collidingBody(const Axes3& position, bool turning) const;

  double tool_radius = 0.0;  ///< [m] over the edges
  double core_radius = 0.0;  ///< [m] between the flutes

 private:
  std::vector<Body> bodies_;
  StationAxes axes_;
};

}  // namespace smartmill::sim
