#pragma once

#include <vector>

#include "smartmill_daq/drivers/driver.h"

namespace smartmill::daq {

/// Of driver_list.cpp, which CMake writes.
std::vector<DriverKind> driverList();

}  // namespace smartmill::daq
