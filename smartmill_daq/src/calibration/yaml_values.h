#pragma once

#include <yaml-cpp/yaml.h>

#include <functional>
#include <string>

namespace smartmill::daq {

/// Replaces or adds a number in the text of a YAML file, whose comments stay.
/// @param map of the file as it is read from this text @param after a key of the map behind which a new one
/// is put
void setValue(std::string& text, const YAML::Node& map, const std::string& key, const std::string& value,
              const std::string& after);

/// Writes the changed text of a file, whose form may not permit the change: unless it is then as expected,
/// the file is restored. @param is_stored may throw Error @throws Error with the fault
void writeChecked(const std::string& file, const std::string& text, const std::function<bool()>& is_stored,
                  const std::string& fault);

}  // namespace smartmill::daq
