#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "smartmill_core/range.h"

namespace smartmill {

/// One parameter of a program: the address of its value and its description.
struct Parameter {
  using Address = std::variant<double*, int*, std::uint64_t*, bool*, std::string*, std::vector<double>*,
                               std::array<double, 3>*>;
  std::string key;
  std::string unit;     ///< "1" for a number without unit, empty for other types
  std::string comment;  ///< meaning, for the shipped file and --help
  Address address;
  Range range = {};                     ///< of a number, or of every number of a list
  std::vector<std::string> words = {};  ///< allowed words; empty: any text
  /// shipped: in the node's file; at_launch: set by the launch file, a comment in the shipped file; internal:
  /// set by programs only, with bounds like the others.
  enum class Where { shipped, at_launch, internal } where = Where::shipped;

  std::string value() const;        ///< as written in a YAML file
  std::string description() const;  ///< "[unit] bounds, comment", one line
  std::string choices() const;      ///< "WORD | WORD", of the allowed words
  /// @throws Error "KEY: VALUE is out of range (...)" or "KEY: 'WORD' is not one of ...".
  void check() const;
};

/// The single declaration of a struct's parameters: key, member, unit, bounds, comment; the default is the
/// member's initialiser. Reader, validation, the commented file of a node and --help use it.
///
/// A struct declares itself in a member function `void declare(ParameterTable& table)`; the table points into
/// that object and must not outlive it. Structs compose by declaring their members.
class ParameterTable {
 public:
  /// Title of the file.
  void title(const std::string& text) { title_ = text; }
  /// Starts a new paragraph of the file. @param text its headline; may be empty
  void section(const std::string& text = "");

  // @throws std::logic_error when the key exists already.
  void number(const std::string& key, double& value, const std::string& unit, const Range& range,
              const std::string& comment);
  void number(const std::string& key, int& value, const std::string& unit, const Range& range,
              const std::string& comment);
  void number(const std::string& key, std::uint64_t& value, const std::string& unit, const Range& range,
              const std::string& comment);
  /// @param range of every number
  void list(const std::string& key, std::vector<double>& values, const std::string& unit, const Range& range,
            const std::string& comment);
  void list(const std::string& key, std::array<double, 3>& values, const std::string& unit,
            const Range& range, const std::string& comment);
  void flag(const std::string& key, bool& value, const std::string& comment);
  void text(const std::string& key, std::string& value, const std::string& comment);
  void choice(const std::string& key, std::string& value, const std::vector<std::string>& words,
              const std::string& comment);
  /// A value that depends on the installation, for example a path: set by the launch file, not by the shipped
  /// file.
  void atLaunch(const std::string& key, std::string& value, const std::string& comment);
  void atLaunch(const std::string& key, bool& value, const std::string& comment);
  /// Bounds of a member that no file sets.
  void internal(const std::string& key, double& value, const std::string& unit, const Range& range);

  /// The parameters of a member struct, with a prefix to their keys.
  template <class Part>
  void part(const std::string& prefix, Part& part) {
    const std::string outer = prefix_;
    prefix_ += prefix;
    part.declare(*this);
    prefix_ = outer;
  }

  const std::vector<Parameter>& parameters() const { return parameters_; }
  /// nullptr when there is no such key.
  const Parameter* find(const std::string& key) const;

  /// Checks every value against its bounds, in order. @throws Error naming key and value.
  void check() const;

  /// The commented file: every key with its value, unit, bounds and meaning; reads back to the same values.
  std::string yaml() const;

 private:
  struct Section {
    std::size_t first;  // parameter that follows it
    std::string text;
  };
  void add(Parameter parameter);

  std::string title_, prefix_;
  std::vector<Parameter> parameters_;
  std::vector<Section> sections_;
};

template <class Parameters>
ParameterTable tableOf(Parameters& parameters) {
  ParameterTable table;
  parameters.declare(table);
  return table;
}

/// Checks a struct against the bounds of its own table. @throws Error naming key and value.
template <class Parameters>
void checkBounds(const Parameters& parameters) {
  Parameters copy = parameters;  // a table points to members that may change
  tableOf(copy).check();
}

}  // namespace smartmill
