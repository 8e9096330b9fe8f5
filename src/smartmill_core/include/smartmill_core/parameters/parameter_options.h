#pragma once

#include <memory>
#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/program.h"

namespace smartmill {

/// Command-line options for the parameters of a node in its offline counterpart: `--params FILE`, options
/// that override single parameters, and the list of all with their defaults at the end of --help.
class ParameterOptions {
 public:
  /// After parsing, the file and then the options are read into the struct. An unknown key, a wrong type or a
  /// value out of its bounds is an Error.
  /// @param table of the struct that the command line changes and that outlives the line
  /// @param shipped path of the node's own file, for --help
  ParameterOptions(CommandLine& line, const ParameterTable& table, const std::string& shipped);

  /// An option, e.g. "--bandwidth-hz", for the parameter of that key (a number or a
  /// word); unit, bounds, meaning and
  /// default in --help come from the table.
  void add(const std::string& option, const std::string& key);

 private:
  struct Given {
    std::string option, key;
    std::shared_ptr<std::string> text = std::make_shared<std::string>();
  };
  struct Values {
    ParameterTable table;
    std::string file;
    std::vector<Given> given;

    void apply() const;
  };
  CommandLine& line_;
  std::shared_ptr<Values> values_;  // shared with the command line
};

}  // namespace smartmill
