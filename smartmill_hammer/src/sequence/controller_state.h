#pragma once

#include <optional>
#include <string>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::hammer {

/// Position of x, y and z as the controller displays it.
struct AxesPosition {
  Axes3 position{{0, 0, 0}};  ///< [m] machine
  double to_go = 0.0;         ///< [m] largest distance to go
};

/// Empty: the state lacks one of the three axes.
std::optional<AxesPosition> axesPosition(const CncState& state);

/// Why no motion may be commanded, one line; empty: it may.
std::string motionFault(const CncState& state);

}  // namespace smartmill::hammer
