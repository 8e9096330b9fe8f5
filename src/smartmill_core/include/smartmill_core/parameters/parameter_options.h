#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/program.h"

namespace smartmill {

/// Command-line options for the parameters of a node in its offline counterpart: `--params FILE`, options
/// that override single parameters, and the list of all with their defaults at the end of --help.
class ParameterOptions {
 public:
  /// @param table of the struct that the command line changes; both outlive this
  /// @param shipped path of the node's own file, for --help
  ParameterOptions(CommandLine& line, const ParameterTable& table, const std::string& shipped);

  /// An option, e.g. "--bandwidth-hz", for the parameter of that key (a number); unit, bounds, meaning and
  /// default in --help come from the table.
  void add(const std::string& option, const std::string& key);

  /// Reads the file, then the options; call it after the command line is parsed.
  /// @throws Error on an unknown key, a wrong type or a value out of its bounds.
  void apply();

 private:
  struct Given {
    std::string option, key;
    std::shared_ptr<std::string> text = std::make_shared<std::string>();
  };
  CommandLine& line_;
  const ParameterTable& table_;
  std::string file_;
  std::vector<Given> given_;
};

}  // namespace smartmill
