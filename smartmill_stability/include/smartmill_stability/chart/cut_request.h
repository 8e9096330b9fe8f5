#pragma once

#include <limits>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Command-line options common to programs on cuts of a machine: model, engagement, speeds, output.
struct CutRequest {
  std::string model, speeds, out;
  double entry_deg = 0.0, exit_deg = 180.0;
  double position_mm = std::numeric_limits<double>::quiet_NaN();

  /// Adds model, engagement and the position along a vibrating workpiece.
  void addCutTo(CommandLine& line);
  /// Adds speeds too. @param form of the option --speeds, for example LO:HI:N
  void addTo(CommandLine& line, const std::string& form);
  /// Adds the required CSV file, next to which a picture is drawn. @param what is drawn, for the help text
  void addOutTo(CommandLine& line, const std::string& what = "a picture");

  /// The model, with the modes of the workpiece at the position if one is stated. @throws Error as
  /// readMachineModel() and atPosition().
  MachineModel machine() const;
  /// @throws Error naming the section that the model lacks.
  RegenerativeSystem system(const MachineModel& machine) const;
  /// [rad/s] of LO:HI:N. @throws Error naming the option.
  std::vector<double> speedRange() const;
};

}  // namespace smartmill::stability
