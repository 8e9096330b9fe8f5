// Copyright (c) SmartMill developers.
// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <rcs.hh>
// LinuxCNC's headers require this order
#include <emc.hh>
#include <emc_nml.hh>
#include <nml_oi.hh>

#include <string>

namespace smartmill::cnc::linuxcnc {

/// The three channels of LinuxCNC's task, opened.
class NmlChannels {
 public:
  /// @param file NML configuration of the controller
  explicit NmlChannels(const std::string& file)
      : status(emcFormat, "emcStatus", "xemc", writable(file)),
        command(emcFormat, "emcCommand", "xemc", writable(file)),
        error(nmlErrorFormat, "emcError", "xemc", writable(file)) {}
  bool valid() { return status.valid() && command.valid() && error.valid(); }
  EMC_STAT& stat() { return *static_cast<EMC_STAT*>(status.get_address()); }

  RCS_STAT_CHANNEL status;
  RCS_CMD_CHANNEL command;
  NML error;

 private:
  static char* writable(const std::string& text) {
    return const_cast<char*>(text.c_str());  // NML takes char* and only reads it
  }
};

}  // namespace smartmill::cnc::linuxcnc
