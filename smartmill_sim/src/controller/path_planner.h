#pragma once

#include <cstddef>

#include "controller/axes_motion.h"
#include "smartmill_sim/controller/controller_options.h"
#include "smartmill_sim/controller/nc_block.h"

namespace smartmill::sim {

/// Modal words of a program.
struct NcModal {
  int motion = 1;  ///< G1
  bool relative = false, inch = false, per_turn = false;
  std::size_t work = 0;  ///< G54
  double feed = 0.0;     ///< in units of the text, per minute or per revolution

  void update(const NcBlock& block);
  double unit() const;  ///< [m] of the text
};

/// Path of a block that moves, from a point [m]. @param offset [m] machine minus workpiece position
/// @throws NcAlarm if a segment leaves the travel of the axes or an arc is inconsistent
AxesMotion::Path pathOf(const NcBlock& block, const NcModal& modal, const AxesMotion::Point& from,
                        const AxesMotion::Point& offset, const ControllerOptions& options);

}  // namespace smartmill::sim
