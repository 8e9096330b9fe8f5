#include "smartmill_core/testing/mill.h"

#include "smartmill_core/units.h"

namespace smartmill {

MachineModel mill(int teeth, double helix_deg) {
  MachineModel model;
  model.file = "model.yaml";
  model.tool = ToolGeometry{teeth, 20e-3, units::radFromDeg(helix_deg), {}};
  model.cutting = CuttingCoefficients{800e6, 300e6, 200e6, 20e3, 25e3, 3e3};
  Spindle spindle;
  spindle.viscous = 4e-4;
  spindle.coulomb = 0.05;
  spindle.load_meter_gain = 4e-4;
  spindle.load_meter_bandwidth = 7.0;
  spindle.load_meter_resolution = 3e-4;
  model.spindle = spindle;
  return model;
}

}  // namespace smartmill
