#pragma once

#include "smartmill_core/model/machine_model.h"

namespace smartmill {

/// The small machine that tests cut with: an end mill of 20 mm in an aluminium (800, 300, 200 N/mm2 and 20,
/// 25, 3 N/mm), a spindle with a load meter of 7 Hz and 0.3 mV. Its tool is rigid, its force sensor ideal:
/// what that shows is what acts. Tests change what they are about.
MachineModel mill(int teeth = 4, double helix_deg = 30.0);

}  // namespace smartmill
