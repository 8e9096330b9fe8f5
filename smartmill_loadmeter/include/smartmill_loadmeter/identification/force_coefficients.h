#pragma once

#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/motor/joint.h"

namespace smartmill::loadmeter {

/// Adds the observable radial and axial coefficients of a joint estimate to a record; its Ktc and Kte remain
/// those of the torque, which account for the common friction.
void addForceCoefficients(const JointResult& joint, CoefficientRecord* record);

}  // namespace smartmill::loadmeter
