#include "stability/study_request.h"

#include <cstdio>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {

void StudyRange::validate() const {
  if (!(speed_low > 0.0) || !(speed_high > speed_low)) throw Error("speeds: expected 0 < low < high");
  if (!(max_depth > 0.0)) throw Error("largest depth: expected above 0");
}

void StudyRequest::addTo(CommandLine& line) {
  CutRequest::addTo(line, "LO:HI");
  line.option("--max-depth-mm", max_depth_mm, "largest depth of the search for limits [mm]").required();
  line.option("--seed", seed, "of the draws (1)");
}

MachineModel StudyRequest::machine() const {
  MachineModel machine = CutRequest::machine();
  machine.needTool("simulate cuts");
  return machine;
}

StudyRange StudyRequest::range() const {
  double low = 0.0, high = 0.0;
  char rest = 0;
  if (std::sscanf(speeds.c_str(), "%lf:%lf%c", &low, &high, &rest) != 2)
    throw Error("--speeds " + speeds + ": expected LO:HI");
  return {units::radPerSecFromRpm(low), units::radPerSecFromRpm(high), max_depth_mm * units::MM, seed};
}

}  // namespace smartmill::stability
