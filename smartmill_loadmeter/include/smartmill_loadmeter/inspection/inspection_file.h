#pragma once

#include <string>
#include <vector>

#include "smartmill_loadmeter/inspection/inspection_record.h"

namespace smartmill::loadmeter {

/// A record of a file and the cut as the file states it.
struct InspectedFeature {
  InspectionRecord record;
  CuttingCondition condition;  ///< what the file does not state is 0
};

/// Measured dimensions of parts and the cuts that made them, smartmill-inspection/1 (docs/formats.md).
/// @throws Error with file, key and value, as recordOf() for a feature that is refused.
std::vector<InspectedFeature> readInspection(const std::string& file,
                                             const InspectionParameters& parameters = {});

}  // namespace smartmill::loadmeter
