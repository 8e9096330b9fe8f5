#pragma once

#include <ros/node_handle.h>

#include "smartmill_core/parameters/parameter_reader.h"

namespace smartmill {

/// All parameters in the namespace of a private node handle. @throws Error if it is no table.
ParameterReader parametersFromServer(const ros::NodeHandle& private_nh);

}  // namespace smartmill
