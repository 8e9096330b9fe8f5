#pragma once

namespace smartmill::nc {

// Orientation of the spindle by M119 (Dunwoody 6.2).

constexpr int ORIENT_VARIABLE = 1133;  ///< contains the angle in steps, 0 .. ORIENT_STEPS - 1
constexpr int ORIENT_STEPS = 4096;     ///< [1] per revolution, of the spindle's encoder

}  // namespace smartmill::nc
