#pragma once

#include <vector>

#include "smartmill_discrepancy/dataset.h"

namespace smartmill::discrepancy {

/// Speed [rad/s] within a share of the stated one at which the lines of the tooth passing stand out most in
/// the forces.
double refinedSpeed(const TestData& test, int teeth, double share);

/// Gives every cut without spindle angle one: the speed from the lines of the tooth passing, the phase at
/// which the nominal forces fit best. The nominal model of an even tool does not know which tooth is which:
/// records are turned by whole teeth so that their lines of once a revolution agree. An air cut gets phase 0.
/// @return a note a record
std::vector<std::string> estimatePhases(Dataset& data);

}  // namespace smartmill::discrepancy
