#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace smartmill::daq {

/// Replaces or adds a number in the text of a YAML file, whose comments stay.
/// @param map of the file as it is read from this text @param after a key of the map behind which a new one
/// is put
void setValue(std::string& text, const YAML::Node& map, const std::string& key, const std::string& value,
              const std::string& after);

}  // namespace smartmill::daq
