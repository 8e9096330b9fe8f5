#include "smartmill_ros/parameter_server.h"

#include <map>
#include <string>
#include <utility>
#include <vector>

#include <XmlRpcValue.h>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

using XmlRpc::XmlRpcValue;

ParameterValue valueOf(XmlRpcValue& value) {
  switch (value.getType()) {
    case XmlRpcValue::TypeBoolean:
      return {static_cast<bool>(value)};
    case XmlRpcValue::TypeInt:
      return {static_cast<int>(value)};
    case XmlRpcValue::TypeDouble:
      return {static_cast<double>(value)};
    case XmlRpcValue::TypeString:
      return {static_cast<std::string>(value)};
    case XmlRpcValue::TypeArray: {
      std::vector<ParameterValue> list;
      for (int i = 0; i < value.size(); ++i) list.push_back(valueOf(value[i]));
      return {list};
    }
    default:
      return {ParameterValue::Table()};
  }
}

}  // namespace

ParameterReader parametersFromServer(const ros::NodeHandle& private_nh) {
  const std::string name = private_nh.getNamespace();
  std::map<std::string, ParameterValue> values;
  XmlRpcValue table;
  if (private_nh.getParam(name, table)) {
    if (table.getType() != XmlRpcValue::TypeStruct) throw Error("parameter " + name + ": expected a table");
    for (auto& entry : table) values.emplace(entry.first, valueOf(entry.second));
  }
  return {name + "/", std::move(values)};
}

}  // namespace smartmill
