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
                   "folder in which explanations (report.json) are looked for; empty: none are shown");
    table.atLaunch("allow_commands", allow_commands,
                   "true: the page may cancel, disarm, measure and install a model, with the token");
    table.atLaunch("token_file", token_file, "file with the token, readable by the operator only");
    table.section("Where it is.");
    table.text("name", name, "of the machine, for people");
    table.text("address", address,
               "to listen at; 127.0.0.1: this computer only, 0.0.0.0: every network it is in");
    table.number("port", port, "1", Range::closed(0, 65535), "0: any free one");
    table.text("names", names,
               "names of this computer under which other computers' browsers may ask, with spaces between");
    table.text("origins", origins,
               "other sites that may connect, with spaces between, e.g. http://localhost:8080");
    table.text("machines", machines,
               "other panels to show a status line of, with spaces between, e.g. http://mill2:8090");
    table.section("How much is borne.");
    table.number("queue", queue, "MB", Range::closed(0.1, 1000.0),
                 "that wait for a client before it loses messages");
    table.number("most_clients", most_clients, "1", Range::closed(1, 10000), "at a time");
    table.section("Digests of the forces.");
    strip.declare(table);
    revolution.declare(table);
    spectrum.declare(table);
    table.number("digest_period", digest_period, "s", Range::closed(0.02, 10.0),
                 "between two messages of revolution and spectrum");
  }
  /// @throws Error naming key and value.
  void validate() const { checkBounds(*this); }
};

}  // namespace smartmill::panel
