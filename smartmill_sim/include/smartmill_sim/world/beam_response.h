#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_sim/world/tool_structure.h"

namespace smartmill::sim {

/// Displacement of a tool (a beam) at a station's sensor and at its tip after a hit.
class BeamResponse {
 public:
  /// @param offset [m] of the hammer above the sensor @param step [s] of integration @throws Error as
  /// ToolStructure() does
  BeamResponse(const StationTraits& traits, const ToolGeometry& tool, double stickout, double offset,
               double step);

  const ToolStructure& structure() const { return structure_; }
  /// Height [m] of the sensor above the tip for the next hit along an axis.
  void setHeight(std::size_t struck_axis, double height);
  /// The tool is at rest.
  void reset();
  /// Whether the tool vibrates at a time [s] under a force [N] of the hammer.
  bool vibrates(double time, double force);
  /// One step of a vibrating tool. @param force [N] on the tool @return [m] of the tip
  std::array<double, 2> step(std::size_t struck_axis, double force);
  const std::array<double, 2>& atSensor() const { return at_sensor_; }  ///< [m] at the last step

 private:
  struct Path {                          // responses to a hit in one axis
    std::vector<ModalFilter> read, tip;  // by axis
    double height = 0.0;                 // [m] of the sensor above the tip
  };

  ToolStructure structure_;
  double offset_, step_, decay_time_;
  std::array<Path, 2> paths_;     // by struck axis
  double vibrates_until_ = -1.0;  // [s]
  std::array<double, 2> at_sensor_{{0, 0}};
};

}  // namespace smartmill::sim
