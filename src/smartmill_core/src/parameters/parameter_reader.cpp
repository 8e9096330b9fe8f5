#include "smartmill_core/parameters/parameter_reader.h"

#include <algorithm>
#include <cmath>
#include <regex>
#include <variant>

#include <yaml-cpp/yaml.h>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

using List = std::vector<ParameterValue>;

// The types that roslaunch's YAML 1.1 loader gives: an exponent needs a dot and a sign to be a number.
ParameterValue typed(const YAML::Node& node) {
  if (node.IsMap()) return {ParameterValue::Table()};
  if (node.IsSequence()) {
    List list;
    for (const YAML::Node& item : node) list.push_back(typed(item));
    return {list};
  }
  const std::string text = node.as<std::string>();
  if (node.Tag() == "!") return {text};  // quoted
  static const std::regex INTEGER("[-+]?(0|[1-9][0-9]*)");
  static const std::regex NUMBER("[-+]?([0-9]+\\.[0-9]*|\\.[0-9]+)([eE][-+][0-9]+)?");
  static const std::regex SPECIAL("[-+]?\\.(inf|Inf|INF)|\\.(nan|NaN|NAN)");
  if (text == "true" || text == "True" || text == "TRUE" || text == "yes" || text == "on") return {true};
  if (text == "false" || text == "False" || text == "FALSE" || text == "no" || text == "off") return {false};
  if (std::regex_match(text, INTEGER)) {
    try {
      return {std::stoi(text)};
    } catch (const std::out_of_range&) {
      return {text};
    }
  }
  if (std::regex_match(text, NUMBER)) return {std::stod(text)};
  if (std::regex_match(text, SPECIAL)) return {node.as<double>()};
  return {text};
}

std::string describe(const ParameterValue& value) {
  if (const bool* flag = std::get_if<bool>(&value.value))
    return *flag ? "'true' is a boolean" : "'false' is a boolean";
  if (const int* integer = std::get_if<int>(&value.value))
    return "'" + std::to_string(*integer) + "' is an integer";
  if (const double* real = std::get_if<double>(&value.value))
    return "'" + std::to_string(*real) + "' is a number";
  if (const auto* text = std::get_if<std::string>(&value.value)) return "'" + *text + "' is a string";
  return std::holds_alternative<List>(value.value) ? "the value is a list" : "the value is a table";
}

double number(const std::string& name, const ParameterValue& value) {
  double result = 0.0;
  if (const int* integer = std::get_if<int>(&value.value)) {
    result = *integer;
  } else if (const double* real = std::get_if<double>(&value.value)) {
    result = *real;
  } else {
    const bool text = std::holds_alternative<std::string>(value.value);
    throw Error("parameter " + name + ": " + describe(value) + ", expected a number" +
                (text ? " (in YAML an exponent needs dot and sign: 1.0e-2)" : ""));
  }
  if (!std::isfinite(result)) throw Error("parameter " + name + ": not a finite number");
  return result;
}

}  // namespace

ParameterReader ParameterReader::fromFile(const std::string& file) {
  std::map<std::string, ParameterValue> values;
  try {
    const YAML::Node root = YAML::LoadFile(file);
    if (root.IsNull()) return {file + ": ", {}};
    if (!root.IsMap()) throw Error(file + ": expected a table of parameters");
    for (const auto& entry : root) {
      const std::string key = entry.first.as<std::string>();
      if (entry.second.IsMap() || entry.second.IsNull())
        throw Error(file + ": " + key + ": expected a value");
      if (!values.emplace(key, typed(entry.second)).second) throw Error(file + ": " + key + " occurs twice");
    }
  } catch (const YAML::BadFile&) {
    throw Error(file + ": cannot be read");
  } catch (const YAML::Exception& e) {
    throw Error(file + ": line " + std::to_string(e.mark.line + 1) + ": " + e.msg);
  }
  return {file + ": ", std::move(values)};
}

const ParameterValue* ParameterReader::find(const std::string& key) {
  read_.insert(key);
  const auto found = values_.find(key);
  return found == values_.end() ? nullptr : &found->second;
}

void ParameterReader::need(const std::string& key) const {
  if (values_.find(key) == values_.end()) throw Error("parameter " + prefix_ + key + " is missing");
}

void ParameterReader::read(const std::string& key, double& value) {
  if (const ParameterValue* found = find(key)) value = number(prefix_ + key, *found);
}

void ParameterReader::read(const std::string& key, int& value) {
  const ParameterValue* found = find(key);
  if (!found) return;
  const auto* given = std::get_if<int>(&found->value);
  if (!given) throw Error("parameter " + prefix_ + key + ": " + describe(*found) + ", expected an integer");
  value = *given;
}

void ParameterReader::read(const std::string& key, std::uint64_t& value) {
  int number = -1;
  if (!find(key)) return;
  read(key, number);
  if (number < 0) throw Error("parameter " + prefix_ + key + ": " + outOfRange(number, Range::notNegative()));
  value = static_cast<std::uint64_t>(number);
}

void ParameterReader::read(const std::string& key, bool& value) {
  const ParameterValue* found = find(key);
  if (!found) return;
  const auto* given = std::get_if<bool>(&found->value);
  if (!given)
    throw Error("parameter " + prefix_ + key + ": " + describe(*found) + ", expected true or false");
  value = *given;
}

void ParameterReader::read(const std::string& key, std::string& value) {
  const ParameterValue* found = find(key);
  if (!found) return;
  const auto* given = std::get_if<std::string>(&found->value);
  if (!given) throw Error("parameter " + prefix_ + key + ": " + describe(*found) + ", expected a string");
  value = *given;
}

void ParameterReader::read(const std::string& key, std::vector<double>& value) {
  const ParameterValue* found = find(key);
  if (!found) return;
  const auto* given = std::get_if<List>(&found->value);
  if (!given)
    throw Error("parameter " + prefix_ + key + ": " + describe(*found) + ", expected a list of numbers");
  std::vector<double> values;
  for (std::size_t i = 0; i < given->size(); ++i)
    values.push_back(number(prefix_ + key + "[" + std::to_string(i) + "]", (*given)[i]));
  value = std::move(values);
}

void ParameterReader::read(const std::string& key, std::array<double, 3>& value) {
  std::vector<double> values(value.begin(), value.end());
  read(key, values);
  if (values.size() != value.size()) {
    throw Error("parameter " + prefix_ + key + ": " + std::to_string(values.size()) +
                " numbers, expected three");
  }
  std::copy(values.begin(), values.end(), value.begin());
}

// A flag that has become a choice is refused with the new words.
void ParameterReader::checkIsWord(const Parameter& parameter) {
  const ParameterValue* found = find(parameter.key);
  if (!found || std::holds_alternative<std::string>(found->value)) return;
  throw Error("parameter " + prefix_ + parameter.key + ": " + describe(*found) +
              ", expected a string: " + parameter.choices());
}

void ParameterReader::read(const ParameterTable& table) {
  for (const Parameter& parameter : table.parameters()) {
    if (parameter.where == Parameter::Where::internal) continue;
    if (!parameter.words.empty()) checkIsWord(parameter);
    std::visit([&](auto* address) { read(parameter.key, *address); }, parameter.address);
  }
  try {
    table.check();
  } catch (const Error& error) {
    throw Error("parameter " + prefix_ + error.what());
  }
}

void ParameterReader::finish() const {
  for (const auto& entry : values_) {
    if (read_.find(entry.first) == read_.end())
      throw Error("parameter " + prefix_ + entry.first + " is unknown");
  }
}

}  // namespace smartmill
