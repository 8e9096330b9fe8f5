#pragma once

#include <string>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/inspection_feature.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/inspection/cut_history.h"
#include "smartmill_loadmeter/inspection/inspection_parameters.h"

namespace smartmill::loadmeter {

/// Record of a measured dimension, without deflection. @throws Error of one line: a missing value or one that
/// is not finite, a difference from nominal above InspectionParameters::largest_difference, a slot narrower
/// than its tool, an unknown kind or direction, times or temperatures that cannot be.
InspectionRecord recordOf(const InspectionFeature& feature, const InspectedCut& cut,
                          const InspectionParameters& parameters);

/// A record for the database, or why the feature is refused.
struct InspectionResult {
  InspectionRecord record;
  CuttingCondition condition;  ///< of the cut
  std::string note;            ///< what the record lacks; one line, empty: nothing
  std::string refusal;         ///< one line; empty: accepted
};

/// Checks a feature against the cuts of this run.
InspectionResult inspect(const InspectionFeature& feature, const CutHistory& cuts,
                         const InspectionParameters& parameters);

/// Sets the deflection of a slot's width (slot_deflection.h), with the modes of the model's tool tip and the
/// newest coefficients of the pair in the database, else the model's.
/// @return why it is not known; one line, empty: it is set, or the feature is no width
std::string setDeflection(const CuttingCondition& cut, const MachineModel& model,
                          const CoefficientDatabase& database, InspectionRecord* record);

}  // namespace smartmill::loadmeter
