#pragma once

#include <limits>
#include <string>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {

// Benchmark in x and y: 0.03993 kg, 922 Hz, 1.1 % damping, two teeth, Kt 6e8 N/m2, Kr/Kt 1/3.
inline ModalModel benchmark() {
  ModalModel model;
  const double w = units::TWO_PI * 922.0;
  model.modes = {{922.0, 0.011, 1.0 / (0.03993 * w * w)}};
  return model;
}

inline MachineModel machine() {
  MachineModel model;
  model.file = "machine.yaml";
  model.tool = ToolGeometry{2, 0.02, 0.0, {}};
  Spindle spindle;
  spindle.viscous = 1e-3;
  spindle.coulomb = 0.1;
  spindle.max_speed = units::radPerSecFromRpm(20000.0);
  spindle.rated_torque = 20.0;
  spindle.rated_power = 8000.0;
  model.spindle = spindle;
  return model;
}

inline MeasuredFrf frf(const std::string& direction, double step) {
  MeasuredFrf measured;
  measured.stamp = 10.0;
  measured.tool = "end_mill";
  measured.point = POINT_TOOL_TIP;
  measured.direction = direction;
  measured.frf.unit = "m/N";
  for (double f = 0.0; f <= 4000.0; f += step) {
    measured.frf.frequency.push_back(f);
    measured.frf.value.push_back(benchmark().response(f));
  }
  return measured;
}

inline CoefficientSet coefficients() {
  CoefficientSet set;
  constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();
  set.stamp = 20.0;
  set.material = "aluminium";
  set.value = {6e8, UNKNOWN, UNKNOWN, 1e4, UNKNOWN, UNKNOWN};
  return set;
}

}  // namespace smartmill::stability
