#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

/// What stands on the table in the tool's way, as boxes in machine coordinates of the tool tip; the tool is a
/// cylinder with its tip's centre at the machine's position.
class CollisionWatch {
 public:
  struct Body {
    std::string name;                       ///< as the alarm says it
    Axes3 low{{0, 0, 0}}, high{{0, 0, 0}};  ///< [m]
  };

  /// Nothing in the way.
  CollisionWatch() = default;
  /// Of a model's hammer stations (sensor and hammer of each direction, where the tool at its station faces
  /// them) and workpiece (the table under it). Needs the tool; without these sections there is nothing.
  static CollisionWatch ofModel(const MachineModel& model);

  void add(const Body& body) { bodies_.push_back(body); }
  const std::vector<Body>& bodies() const { return bodies_; }

  /// The body that the tool reaches into at a position [m]; nothing: free. A standing tool may turn the room
  /// between two flutes to it, so only its core counts. @param turning the spindle turns
  const Body* touched(const Axes3& position, bool turning) const;

  double tool_radius = 0.0;  ///< [m] over the edges
  double core_radius = 0.0;  ///< [m] between the flutes

 private:
  std::vector<Body> bodies_;
};

}  // namespace smartmill::sim
