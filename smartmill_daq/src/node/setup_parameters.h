#pragma once

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::daq {

/// Parameters of setup_node.
struct SetupNodeParameters {
  std::string folder;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of setup_node (package smartmill_daq): first connection and calibration of instruments.");
    table.atLaunch("folder", folder,
                   "existing folder in which the node writes instrument files, absolute path");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    if (folder.empty() || folder.front() != '/')
      throw Error("folder: '" + folder + "', expected an absolute path");
  }
};

}  // namespace smartmill::daq
