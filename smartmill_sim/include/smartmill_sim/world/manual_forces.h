#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "smartmill_sim/world/solenoid.h"

namespace smartmill::sim {

/// Forces on tool and workpiece that are neither cut nor hammer station: hits by hand or by a simple hammer,
/// and a constant force (a weight).
class ManualForces {
 public:
  using Vector = std::array<double, 3>;

  /// Begins a hit along an axis. @param on_tool at the tool's tip; otherwise on the workpiece at tap_point,
  /// along an axis of the force sensor
  void hit(bool on_tool, std::size_t axis, const Hit& hit);
  bool hitting(double time) const;
  /// Constant force [N] on the tool's tip from now on. @param on_table whether it acts between tool and
  /// workpiece
  void pull(const Vector& force, bool on_table);

  struct Forces {
    Vector tip{{0, 0, 0}};                  ///< [N] on the tool's tip
    std::array<double, 2> tip_hit{{0, 0}};  ///< [N] contained in it: the hit in x and y
    Vector workpiece{{0, 0, 0}};            ///< [N] hit on the workpiece
    Vector table{{0, 0, 0}};                ///< [N] on the workpiece in all
    double hammer = 0.0;                    ///< [N] signal of the hammer
  };
  Forces at(double time) const;  ///< time [s]
  /// Skips a time [s].
  void skipTime(double time);

  Vector tap_point{{0, 0, 0}};  ///< [m] point of hits on the workpiece, from the plate's origin
  /// Row-major rotation from the axes of the force sensor to those of the machine.
  std::array<double, 9> from_sensor{{1, 0, 0, 0, 1, 0, 0, 0, 1}};

 private:
  struct AxisHit {
    std::optional<Hit> hit;
    std::size_t axis = 0;
  };
  AxisHit workpiece_, tool_;
  Vector pull_{{0, 0, 0}};
  bool pull_on_table_ = false;
};

}  // namespace smartmill::sim
