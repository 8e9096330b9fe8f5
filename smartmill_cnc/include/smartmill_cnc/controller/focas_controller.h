#pragma once

#include <memory>
#include <string>

#include "smartmill_cnc/controller/controller.h"
#include "smartmill_core/nc/orientation.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::cnc {

struct FocasParameters {
  std::string host = "127.0.0.1";
  int port = 8193;
  double reply_timeout = 0.5;
  int spindle = 1;
  int marker_macro = 100;
  int orient_macro = nc::ORIENT_VARIABLE;
  int override_data = -1;
  double temperature_period = 5.0;

  void declare(ParameterTable& table) {
    table.text("host", host, "name or address of the controller, real or simulated");
    table.number("port", port, "1", Range::closed(1, 65535), "FOCAS port");
    table.number("reply_timeout", reply_timeout, "s", Range::positive(),
                 "timeout of connecting and of every reply; then the connection counts as lost");
    table.number("spindle", spindle, "1", Range::positive(), "number of the milling spindle, from 1");
    table.number("marker_macro", marker_macro, "1", Range::closed(1, 99999),
                 "variable #n that marks the end of a program; programs must not use it");
    table.number("orient_macro", orient_macro, "1", Range::closed(1, 99999),
                 "variable from which M119 reads the spindle angle, 0 .. 4095");
    table.number(
        "override_data", override_data, "1", Range::closed(-1, 9998),
        "PMC data table: number of the byte D whose percentage the machine's ladder multiplies into the feed "
        "override; the next byte is for the spindle; 0 means 100; -1: the ladder has no such rungs, "
        "overrides "
        "are refused");
    table.number(
        "temperature_period", temperature_period, "s", Range::closed(0.0, 3600.0),
        "period of machine/temperature, from the diagnosis numbers 308, 309 and 403; motors warm up in "
        "minutes; 0: not read");
  }

  /// @throws Error naming key and value.
  void validate() const;
};

/// A Fanuc controller over FOCAS2 Ethernet. Programs are pieces of one long DNC session: the text, then
/// #marker=k; a program has been executed when the variable has this value (Dunwoody 6.2 and 7.1).
/// @throws Error of FocasParameters::validate().
std::unique_ptr<Controller> makeFocasController(const FocasParameters& parameters);

}  // namespace smartmill::cnc
