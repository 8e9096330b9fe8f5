#pragma once

#include <limits>
#include <map>
#include <string>
#include <vector>

#include "smartmill_core/signal/inspection_feature.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// Measured dimensions of parts and the cuts that made them, smartmill-inspection/1 (docs/formats.md).
struct InspectionFile {
  struct Cut {
    CuttingCondition condition;  ///< what the file does not state is 0
    double edge_age =
        std::numeric_limits<double>::quiet_NaN();  ///< [s] cutting time of the edge; NaN: unknown
  };
  struct Dimension {
    InspectionFeature feature;
    std::string path;  ///< where in the file, for errors
  };
  std::map<std::string, Cut> cuts;  ///< by name
  std::vector<Dimension> features;
};

/// @throws Error with file, key and value.
InspectionFile readInspectionFile(const std::string& file);

}  // namespace smartmill
