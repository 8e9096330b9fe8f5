#include "stability/study_request.h"

#include <cstdio>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {

void StudyRange::validate() const {
  if (!(speed_low > 0.0) || !(speed_high > speed_low)) throw Error("speeds: 0 < low < high is due");
  if (!(max_depth > 0.0)) throw Error("largest depth: above 0 is due");
}

void StudyRequest::addTo(CommandLine& line) {
  CutRequest::addTo(line, "LO:HI");
  line.option("--max-depth-mm", max_depth_mm, "limits are looked for up to here [mm]").required();
  line.option("--seed", seed, "of the draws (1)");
}

MachineModel StudyRequest::machine() const {
  MachineModel machine = readMachineModel(model);
  machine.needTool("simulate cuts");
  return machine;
}

StudyRange StudyRequest::range() const {
  double low = 0.0, high = 0.0;
  char rest = 0;
  if (std::sscanf(speeds.c_str(), "%lf:%lf%c", &low, &high, &rest) != 2)
    throw Error("--speeds " + speeds + ": LO:HI is due");
  return {units::radPerSecFromRpm(low), units::radPerSecFromRpm(high), max_depth_mm * units::MM, seed};
}

}  // namespace smartmill::stability
