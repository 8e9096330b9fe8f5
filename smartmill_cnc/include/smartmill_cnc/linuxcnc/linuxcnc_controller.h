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

  void declare(ParameterTable& table) {
    table.text("linuxcnc_folder", folder, "of the machine: where linuxcnc_machine has its sockets");
    table.number("linuxcnc_timeout", timeout, "s", Range::positive(),
                 "for every answer of its gateway; longer is a lost connection");
  }
};

/// The text that LinuxCNC runs for a program of the bridge's dialect as checkProgram() writes it: dwells in
/// seconds, an exact stop at the end of every block, M5 and M119 waited for as a Fanuc does, and before every
/// motion M67, so that each servo sample tells by its marker which line of the program it belongs to.
std::string linuxCncText(const std::string& program);

/// LinuxCNC behind linuxcnc_gateway and linuxcnc_stream. A program goes to it as a subroutine that is called
/// by MDI. Its mode passes for DNC while it takes programs from outside: in MDI, and before arming in manual
/// too. After an emergency stop or an error the panel (`linuxcnc_panel FOLDER ready`) has to make it ready.
/// @param stream of the same machine; others may drive it
std::unique_ptr<Controller> makeLinuxCncController(const LinuxCncParameters& parameters,
                                                   std::shared_ptr<const ServoStream> stream,
                                                   double (*now)());

}  // namespace smartmill::cnc::linuxcnc
