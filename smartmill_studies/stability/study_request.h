#pragma once

#include <string>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_stability/solvers/solver.h"
#include "stability/study_range.h"

namespace smartmill::stability {

/// What every study of this folder is asked on its command line: a machine, an arc, a range.
struct StudyRequest {
  std::string model, speeds, out;
  double entry_deg = 0.0, exit_deg = 180.0, max_depth_mm = 0.0;
  unsigned seed = 1;

  void addTo(CommandLine& line);

  /// @throws Error on a model without a tool.
  MachineModel machine() const;
  RegenerativeSystem system(const MachineModel& machine) const;
  /// @throws Error on speeds that are not LO:HI.
  StudyRange range() const;
};

}  // namespace smartmill::stability
