#pragma once

#include <memory>
#include <string>

#include "smartmill_cnc/controller/controller.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::cnc {

struct FocasParameters {
  std::string host = "127.0.0.1";
  int port = 8193;
  double reply_timeout = 0.5;
  int spindle = 1;
  int marker_macro = 100;
  int orient_macro = 1133;
  int override_data = -1;

  void declare(ParameterTable& table) {
    table.text("host", host, "controller's name or address; a real one or the simulated one");
    table.number("port", port, "1", Range::closed(1, 65535), "its FOCAS port");
    table.number("reply_timeout", reply_timeout, "s", Range::positive(),
                 "for connecting and for every answer; longer is a lost connection");
    table.number("spindle", spindle, "1", Range::positive(), "which spindle is the milling spindle, from 1");
    table.number("marker_macro", marker_macro, "1", Range::closed(1, 99999),
                 "variable #n that tells the end of a program; programs must leave it alone");
    table.number("orient_macro", orient_macro, "1", Range::closed(1, 99999),
                 "variable that M119 reads the spindle's angle from, 0 .. 4095");
    table.number(
        "override_data", override_data, "1", Range::closed(-1, 9998),
        "PMC data table: the byte D of this number is a percentage that the machine's ladder multiplies "
        "into the feed override, the next byte into the spindle's, 0 and 100 alike; -1: the ladder has "
        "no such rungs, overrides are refused");
  }

  /// @throws Error naming key and value.
  void validate() const;
};

/// A Fanuc controller over FOCAS2 Ethernet. A program goes to it as a piece of one long DNC session: its
/// text, then #marker=k; all of it has been executed when the variable is set (Dunwoody 6.2 and 7.1).
/// @throws Error of FocasParameters::validate().
std::unique_ptr<Controller> makeFocasController(const FocasParameters& parameters);

}  // namespace smartmill::cnc
