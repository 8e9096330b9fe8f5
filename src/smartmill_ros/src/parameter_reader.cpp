#include "smartmill_ros/parameter_reader.h"

#include <algorithm>
#include <cmath>
#include <regex>
#include <variant>

#include <yaml-cpp/yaml.h>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

using XmlRpc::XmlRpcValue;

// The types that roslaunch's YAML 1.1 loader gives: an exponent needs a dot and a sign to be a number.
XmlRpcValue typed(const YAML::Node& node) {
  if (node.IsSequence()) {
    XmlRpcValue list;
    list.setSize(static_cast<int>(node.size()));
    for (std::size_t i = 0; i < node.size(); ++i) list[static_cast<int>(i)] = typed(node[i]);
    return list;
  }
  const std::string text = node.as<std::string>();
  if (node.Tag() == "!") return XmlRpcValue(text);  // quoted
  static const std::regex INTEGER("[-+]?(0|[1-9][0-9]*)");
  static const std::regex NUMBER("[-+]?([0-9]+\\.[0-9]*|\\.[0-9]+)([eE][-+][0-9]+)?");
  static const std::regex SPECIAL("[-+]?\\.(inf|Inf|INF)|\\.(nan|NaN|NAN)");
  if (text == "true" || text == "True" || text == "TRUE" || text == "yes" || text == "on")
    return XmlRpcValue(true);
  if (text == "false" || text == "False" || text == "FALSE" || text == "no" || text == "off")
    return XmlRpcValue(false);
  if (std::regex_match(text, INTEGER)) {
    try {
      return XmlRpcValue(std::stoi(text));
    } catch (const std::out_of_range&) {
      return XmlRpcValue(text);
    }
  }
  if (std::regex_match(text, NUMBER)) return XmlRpcValue(std::stod(text));
  if (std::regex_match(text, SPECIAL)) return XmlRpcValue(node.as<double>());
  return XmlRpcValue(text);
}

std::string describe(XmlRpcValue value) {
  switch (value.getType()) {
    case XmlRpcValue::TypeBoolean:
      return static_cast<bool>(value) ? "'true' is a truth value" : "'false' is a truth value";
    case XmlRpcValue::TypeInt:
      return "'" + std::to_string(static_cast<int>(value)) + "' is an integer";
    case XmlRpcValue::TypeDouble:
      return "'" + std::to_string(static_cast<double>(value)) + "' is a number";
    case XmlRpcValue::TypeString:
      return "'" + static_cast<std::string>(value) + "' is a string";
    case XmlRpcValue::TypeArray:
      return "the value is a list";
    default:
      return "the value is a table";
  }
}

double number(const std::string& name, XmlRpcValue value) {
  double result = 0.0;
  if (value.getType() == XmlRpcValue::TypeInt) {
    result = static_cast<int>(value);
  } else if (value.getType() == XmlRpcValue::TypeDouble) {
    result = static_cast<double>(value);
  } else {
    std::string hint;
    if (value.getType() == XmlRpcValue::TypeString)
      hint = " (in YAML an exponent needs dot and sign: 1.0e-2)";
    throw Error("parameter " + name + ": " + describe(value) + ", a number is due" + hint);
  }
  if (!std::isfinite(result)) throw Error("parameter " + name + ": not a finite number");
  return result;
}

}  // namespace

ParameterReader ParameterReader::fromServer(const ros::NodeHandle& private_nh) {
  ParameterReader reader(private_nh.getNamespace() + "/");
  XmlRpcValue table;
  if (!private_nh.getParam(private_nh.getNamespace(), table)) return reader;
  if (table.getType() != XmlRpcValue::TypeStruct) {
    throw Error("parameter " + private_nh.getNamespace() + ": " + describe(table) + ", a table is due");
  }
  for (auto& entry : table) reader.values_[entry.first] = entry.second;
  return reader;
}

ParameterReader ParameterReader::fromFile(const std::string& file) {
  ParameterReader reader(file + ": ");
  try {
    const YAML::Node root = YAML::LoadFile(file);
    if (root.IsNull()) return reader;
    if (!root.IsMap()) throw Error(file + ": a table of parameters is due");
    for (const auto& entry : root) {
      const std::string key = entry.first.as<std::string>();
      if (entry.second.IsMap() || entry.second.IsNull()) throw Error(file + ": " + key + ": a value is due");
      if (!reader.values_.emplace(key, typed(entry.second)).second)
        throw Error(file + ": " + key + " stands twice");
    }
  } catch (const YAML::BadFile&) {
    throw Error(file + ": cannot be read");
  } catch (const YAML::Exception& e) {
    throw Error(file + ": line " + std::to_string(e.mark.line + 1) + ": " + e.msg);
  }
  return reader;
}

XmlRpc::XmlRpcValue* ParameterReader::find(const std::string& key) {
  read_.insert(key);
  const auto found = values_.find(key);
  return found == values_.end() ? nullptr : &found->second;
}

void ParameterReader::need(const std::string& key) const {
  if (values_.find(key) == values_.end()) throw Error("parameter " + prefix_ + key + " is missing");
}

void ParameterReader::read(const std::string& key, double& value) {
  if (const XmlRpcValue* found = find(key)) value = number(prefix_ + key, *found);
}

void ParameterReader::read(const std::string& key, int& value) {
  XmlRpcValue* found = find(key);
  if (!found) return;
  if (found->getType() != XmlRpcValue::TypeInt) {
    throw Error("parameter " + prefix_ + key + ": " + describe(*found) + ", an integer is due");
  }
  value = static_cast<int>(*found);
}

void ParameterReader::read(const std::string& key, std::uint64_t& value) {
  int number = -1;
  if (!find(key)) return;
  read(key, number);
  if (number < 0) throw Error("parameter " + prefix_ + key + ": " + outOfRange(number, Range::notNegative()));
  value = static_cast<std::uint64_t>(number);
}

void ParameterReader::read(const std::string& key, bool& value) {
  XmlRpcValue* found = find(key);
  if (!found) return;
  if (found->getType() != XmlRpcValue::TypeBoolean) {
    throw Error("parameter " + prefix_ + key + ": " + describe(*found) + ", true or false is due");
  }
  value = static_cast<bool>(*found);
}

void ParameterReader::read(const std::string& key, std::string& value) {
  XmlRpcValue* found = find(key);
  if (!found) return;
  if (found->getType() != XmlRpcValue::TypeString) {
    throw Error("parameter " + prefix_ + key + ": " + describe(*found) + ", a string is due");
  }
  value = static_cast<std::string>(*found);
}

void ParameterReader::read(const std::string& key, std::vector<double>& value) {
  XmlRpcValue* found = find(key);
  if (!found) return;
  if (found->getType() != XmlRpcValue::TypeArray) {
    throw Error("parameter " + prefix_ + key + ": " + describe(*found) + ", a list of numbers is due");
  }
  std::vector<double> values;
  for (int i = 0; i < found->size(); ++i) {
    values.push_back(number(prefix_ + key + "[" + std::to_string(i) + "]", (*found)[i]));
  }
  value = std::move(values);
}

void ParameterReader::read(const std::string& key, std::array<double, 3>& value) {
  std::vector<double> values(value.begin(), value.end());
  read(key, values);
  if (values.size() != value.size()) {
    throw Error("parameter " + prefix_ + key + ": " + std::to_string(values.size()) +
                " numbers, three are due");
  }
  std::copy(values.begin(), values.end(), value.begin());
}

void ParameterReader::read(const ParameterTable& table) {
  for (const Parameter& parameter : table.parameters()) {
    if (parameter.where == Parameter::Where::internal) continue;
    std::visit([&](auto* place) { read(parameter.key, *place); }, parameter.place);
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
