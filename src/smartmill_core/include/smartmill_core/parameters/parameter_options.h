#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/program.h"

namespace smartmill {

/// The parameters of a node on the command line of a tool that does offline what the node does: `--params
/// FILE`, options for single ones over it, and all of them with their defaults at the end of --help.
class ParameterOptions {
 public:
  /// @param table of the struct that the command line changes; both outlive this
  /// @param shipped where the node's own file lies, for --help
  ParameterOptions(CommandLine& line, const ParameterTable& table, const std::string& shipped);

  /// An option, e.g. "--bandwidth-hz", for the parameter of that key (a number); unit, bounds, meaning and
  /// default in --help are the table's.
  void add(const std::string& option, const std::string& key);

  /// After the command line was parsed: the file, then the options.
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
