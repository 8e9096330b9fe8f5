#pragma once

#include <string>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_panel/digest/force_revolution.h"
#include "smartmill_panel/digest/force_spectrum.h"
#include "smartmill_panel/digest/force_strip.h"

namespace smartmill::panel {

struct PanelParameters {
  std::string page, reports, token_file;
  bool allow_commands = false;
  std::string name = "SmartMill";
  std::string address = "127.0.0.1";
  int port = 8090;
  std::string names, origins, machines;
  double queue = 4.0;
  int most_clients = 64;
  StripParameters strip;
  RevolutionParameters revolution;
  SpectrumParameters spectrum;
  double digest_period = 0.1;

  void declare(ParameterTable& table) {
    table.title("Parameters of panel_node (package smartmill_panel): the page in the browser.");
    table.atLaunch("page", page, "folder of the page");
    table.atLaunch("reports", reports,
                   "folder searched for explanations (report.json); empty: none are shown");
    table.atLaunch(
        "allow_commands", allow_commands,
        "true: the page may hold the feed, cancel, disarm, measure and install a model, with the token");
    table.atLaunch("token_file", token_file, "file with the token, readable by the operator only");
    table.section("Address.");
    table.text("name", name, "name of the machine on the page");
    table.text("address", address,
               "address to listen at; 127.0.0.1: this computer only, 0.0.0.0: all networks");
    table.number("port", port, "1", Range::closed(0, 65535), "port to listen at; 0: any free one");
    table.text("names", names,
               "host names of this computer permitted in requests of other computers, separated by spaces");
    table.text("origins", origins,
               "other permitted origins, separated by spaces, for example http://localhost:8080");
    table.text("machines", machines,
               "other panels whose status line is shown, separated by spaces, for example http://mill2:8090");
    table.section("Limits.");
    table.number("queue", queue, "MB", Range::closed(0.1, 1000.0),
                 "queued for a client before it loses messages");
    table.number("most_clients", most_clients, "1", Range::closed(1, 10000), "most clients at a time");
    table.section("Digests of the forces.");
    strip.declare(table);
    revolution.declare(table);
    spectrum.declare(table);
    table.number("digest_period", digest_period, "s", Range::closed(0.02, 10.0),
                 "time between two messages of revolution and spectrum");
  }
  /// @throws Error naming key and value.
  void validate() const { checkBounds(*this); }
};

}  // namespace smartmill::panel
