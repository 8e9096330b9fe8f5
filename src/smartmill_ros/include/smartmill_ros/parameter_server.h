#pragma once

#include <ros/node_handle.h>

#include "smartmill_core/parameters/parameter_reader.h"

namespace smartmill {

/// All parameters below a private node handle. @throws Error when the namespace holds no table.
ParameterReader parametersFromServer(const ros::NodeHandle& private_nh);

}  // namespace smartmill
