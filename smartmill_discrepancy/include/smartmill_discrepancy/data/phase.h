#pragma once

#include <vector>

#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// Speed [rad/s] within a share of the stated one at which the lines of the tooth passing stand out most in
/// the forces.
double refinedSpeed(const TestData& test, int teeth, double share);

/// Gives every cut without spindle angle one: the speed from the lines of the tooth passing, the phase at
/// which the nominal forces fit best. The nominal model of an even tool does not know which tooth is which:
/// records are turned by whole teeth, air cuts by any angle, so that their lines of once a revolution agree.
/// @return a note a record
std::vector<std::string> estimatePhases(Dataset& data);

/// Turns the records without spindle angle to where a model's forces fit best, tooth and speed included: a
/// model with effects knows which tooth is which, and lines of once a revolution in air.
/// @return the largest change of an angle [rad], 0 where every record has its angle
double turnPhases(Dataset& data, const MachineModel& model);

}  // namespace smartmill::discrepancy
