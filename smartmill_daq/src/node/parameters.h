#pragma once

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::daq {

/// Parameters of daq_node.
struct DaqNodeParameters {
  std::string instrument;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of daq_node (package smartmill_daq): sample blocks of an instrument, which has a file of "
        "its own.");
    table.atLaunch("instrument", instrument, "path of a smartmill-instrument/1 file");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    if (instrument.empty())
      throw Error("instrument: empty, expected the path of a smartmill-instrument/1 file");
  }
};

}  // namespace smartmill::daq
