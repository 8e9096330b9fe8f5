#pragma once

#include <optional>
#include <string>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// The cut or air cut, among variations of the campaign's tests, in which two models differ most.
std::optional<std::string> separatingTest(const Dataset& data, const MachineModel& a, const MachineModel& b);

}  // namespace smartmill::discrepancy
