#pragma once

#include <array>
#include <optional>
#include <vector>

#include "smartmill_core/cutting/contact_arc.h"
#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/model/effect.h"
#include "smartmill_sim/twin/milling_process.h"

namespace smartmill::sim {

/// Forces of edge layers, added to the force of the whole edge: each layer is a cutter of its own down to the
/// layer's depth, whose force is multiplied by the layer's weight. An edge that varies over its height is
/// thus a sum of uniform ones: full depth minus a lower layer is the upper layer. The cutters of the layers
/// are straight mills.
class EdgeLayers {
 public:
  EdgeLayers() = default;
  /// @param setup with the changes by all effects @param rigid a tool without vibration at steady feed
  EdgeLayers(const TwinSetup& setup, const CuttingLaw& law, double time_step, bool rigid);

  bool empty() const { return layers_.empty(); }
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now);
  /// The same arcs with other depths.
  void setDepths(const std::vector<ContactArc>& arcs);
  void setLaw(const CuttingLaw& law);
  /// Other radii of the teeth of the whole edge from now on. @throws Error for layers of tables.
  void setRadii(const std::vector<double>& radius_offset);
  void add(const ToolMotion& now, CuttingForce& sum);
  /// Ends the step of a tool that may vibrate. @param displacement [m] of the tip
  void endStep(const std::array<double, 2>& displacement);

 private:
  struct Layer {
    EdgeLayer definition;
    std::optional<RigidCut> rigid;
    std::optional<MillingProcess> process;
  };
  std::vector<Layer> layers_;
};

}  // namespace smartmill::sim
