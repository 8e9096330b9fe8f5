#pragma once

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_stability/chart/cut_request.h"
#include "stability/study_range.h"

namespace smartmill::stability {

/// Command line options of every study in this folder: machine, arc, range.
struct StudyRequest : CutRequest {
  double max_depth_mm = 0.0;
  unsigned seed = 1;

  void addTo(CommandLine& line);

  /// @throws Error on a model without a tool.
  MachineModel machine() const;
  /// @throws Error on speeds other than LO:HI.
  StudyRange range() const;
};

}  // namespace smartmill::stability
