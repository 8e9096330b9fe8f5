#pragma once

#include <vector>

#include "smartmill_sim/controller/motion_state.h"
#include "smartmill_sim/twin/cutting_machine.h"
#include "smartmill_sim/world/stock.h"

namespace smartmill::sim {

/// Contact of the tool with the stock as the tool moves through it.
class StockContact {
 public:
  StockContact(const Workpiece& workpiece, const ToolGeometry& tool) : stock_(workpiece, tool) {}

  struct Fault {
    int alarm = 0;  ///< number of an external alarm; 0: none
    const char* text = "";
  };
  /// Another tool, out of contact.
  void changeTool(const ToolGeometry& tool) {
    stock_.changeTool(tool);
    arcs_.clear();
  }
  /// Updates stock and contact. @param now the same motion for the machine @return a contact without cut
  Fault update(const MotionState& state, const ToolMotion& now, CuttingMachine& machine);

 private:
  Stock stock_;
  std::vector<ContactArc> arcs_;
};

}  // namespace smartmill::sim
