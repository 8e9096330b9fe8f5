#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/controller/motion_watch.h"

namespace smartmill::sim {

/// Obstacles on the table as boxes in machine coordinates of the tool tip. The tool is a cylinder whose tip
/// has its centre at the machine position.
class CollisionWatch : public MotionWatch {
 public:
  struct Body {
    std::string name;                       ///< as named in the alarm
    Axes3 low{{0, 0, 0}}, high{{0, 0, 0}};  ///< [m]
  };

  /// No obstacles.
  CollisionWatch() = default;
  /// Obstacles of a model: sensor and hammer of each direction of its hammer station, and the table under its
  /// workpiece. None without a tool or without these sections.
  static CollisionWatch ofModel(const MachineModel& model);

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
};

}  // namespace smartmill::sim
