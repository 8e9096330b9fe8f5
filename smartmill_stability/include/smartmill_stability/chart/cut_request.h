#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// What programs that look at cuts of a machine are asked on their command line: the machine, an arc, speeds.
struct CutRequest {
  std::string model, speeds, out;
  double entry_deg = 0.0, exit_deg = 180.0;

  /// @param form of the speeds, e.g. LO:HI:N
  void addTo(CommandLine& line, const std::string& form);
  /// A CSV file that must be named, with a picture beside it. @param what the picture is
  void addOutTo(CommandLine& line, const std::string& what = "a picture");

  /// @throws Error on a file that cannot be read or lacks something.
  RegenerativeSystem system(const MachineModel& machine) const;
  /// [rad/s] of LO:HI:N. @throws Error naming the option.
  std::vector<double> speedRange() const;
};

}  // namespace smartmill::stability
