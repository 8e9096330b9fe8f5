#pragma once

#include "smartmill_core/model/machine_model.h"

namespace smartmill {

/// A small machine for tests: an end mill of 20 mm in an aluminium (800, 300, 200 N/mm2 and 20, 25, 3 N/mm),
/// a spindle with a load meter of 7 Hz and 0.3 mV. The tool is rigid and the force sensor ideal: it measures
/// the acting force. Tests change the properties under test.
MachineModel mill(int teeth = 4, double helix_deg = 30.0);

}  // namespace smartmill
