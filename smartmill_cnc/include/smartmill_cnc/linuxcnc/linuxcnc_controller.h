#pragma once

#include <memory>
#include <string>

#include "smartmill_cnc/controller/controller.h"
#include "smartmill_cnc/linuxcnc/servo_stream.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::cnc::linuxcnc {

struct LinuxCncParameters {
  std::string folder;
  double timeout = 1.5;

  // Set by programs only.
  double stream_timeout = 0.4;  ///< [s] of silence of the servo stream: a loss is reported within 0.5 s

  void declare(ParameterTable& table) {
    table.text("linuxcnc_folder", folder, "folder of the machine, with the sockets of linuxcnc_machine");
    table.number("linuxcnc_timeout", timeout, "s", Range::positive(),
                 "timeout of every reply of the gateway; then the connection counts as lost");
  }
};

/// Translates a program of the bridge's dialect (output of checkProgram()) for LinuxCNC: dwells in seconds,
/// an exact stop at the end of every block, M5 and M119 wait for the spindle as on a Fanuc, and M67 before
/// every motion marks each servo sample with the line of the program.
std::string linuxCncText(const std::string& program);

/// LinuxCNC with linuxcnc_gateway and linuxcnc_stream. A program is a subroutine called by MDI. The reported
/// mode is DNC while programs are accepted: in MDI, and in manual mode before arming. After an emergency stop
/// or an error `linuxcnc_panel FOLDER ready` is required.
/// @param stream of the same machine; step() is called elsewhere @param now [s] any steady time
std::unique_ptr<Controller> makeLinuxCncController(const LinuxCncParameters& parameters,
                                                   std::shared_ptr<const ServoStream> stream,
                                                   double (*now)());

}  // namespace smartmill::cnc::linuxcnc
