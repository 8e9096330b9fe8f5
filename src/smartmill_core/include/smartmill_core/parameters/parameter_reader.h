#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill {

/// A value with its type in a parameter file or on the parameter server.
struct ParameterValue {
  struct Table {};  ///< where one value is expected
  std::variant<bool, int, double, std::string, std::vector<ParameterValue>, Table> value;
};

/// Strict reading of a node's parameters: a wrong type or an unknown key is an error of one line, never
/// silently replaced by a default. The parameter server (smartmill_ros/parameter_server.h) and YAML files of
/// offline tools follow the same rules.
class ParameterReader {
 public:
  /// @param prefix of keys in messages: file or namespace
  ParameterReader(std::string prefix, std::map<std::string, ParameterValue> values)
      : prefix_(std::move(prefix)), values_(std::move(values)) {}
  /// A flat YAML table; scalars get the types of roslaunch (`1e-2` is a string). @throws Error.
  static ParameterReader fromFile(const std::string& file);

  /// Reads a parameter if present; otherwise value is unchanged. An int is accepted for a double, not the
  /// reverse.
  /// @throws Error naming the parameter and its value: wrong type, NaN or infinite number.
  void read(const std::string& key, double& value);
  void read(const std::string& key, int& value);
  void read(const std::string& key, std::uint64_t& value);
  void read(const std::string& key, bool& value);
  void read(const std::string& key, std::string& value);
  void read(const std::string& key, std::vector<double>& value);
  void read(const std::string& key, std::array<double, 3>& value);

  /// Reads every parameter of a table. @throws Error as above, or on a value out of its bounds.
  void read(const ParameterTable& table);

  /// Like read(), but the parameter is required. @throws Error "parameter X is missing".
  template <class T>
  void require(const std::string& key, T& value) {
    need(key);
    read(key, value);
  }

  /// @throws Error naming one parameter that was not read.
  void finish() const;

  /// Reads all parameters into a struct that declares itself; absent ones keep their default.
  /// @throws Error on an unknown key, a wrong type, a value out of its bounds or one that validate() rejects.
  template <class Parameters>
  Parameters readAll() {
    Parameters parameters;
    read(tableOf(parameters));
    finish();
    parameters.validate();
    return parameters;
  }

 private:
  void need(const std::string& key) const;
  void checkIsWord(const Parameter& parameter);
  const ParameterValue* find(const std::string& key);

  std::string prefix_;
  std::map<std::string, ParameterValue> values_;
  std::set<std::string> read_;
};

}  // namespace smartmill
