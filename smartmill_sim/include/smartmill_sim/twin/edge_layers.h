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

/// What lower parts of the cutter's edges add to the force of the whole: each is a cutter of its own, as deep
/// as the layer reaches, whose force counts with the layer's weight. So an edge that is not the same all
/// along needs no other kernel: full depth less a lower part leaves the upper one.
class EdgeLayers {
 public:
  EdgeLayers() = default;
  /// @param setup after all effects have changed it @param rigid a tool that does not vibrate, at steady feed
  EdgeLayers(const TwinSetup& setup, const CuttingLaw& law, double time_step, bool rigid);

  bool empty() const { return layers_.empty(); }
  void engage(const std::vector<ContactArc>& arcs, const ToolMotion& now);
  void setDepths(const std::vector<double>& depths);
  void setLaw(const CuttingLaw& law);
  void add(const ToolMotion& now, CuttingForce& sum);
  /// Of a tool that may vibrate: ends the step with the tip there [m].
  void settle(const std::array<double, 2>& displacement);

 private:
  struct Layer {
    EdgeLayer of;
    std::optional<RigidCut> rigid;
    std::optional<MillingProcess> process;
  };
  std::vector<Layer> layers_;
};

}  // namespace smartmill::sim
