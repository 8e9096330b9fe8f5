#include <yaml-cpp/yaml.h>

#include <cmath>

#include "calibration/yaml_values.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_daq/calibration/sensitivity.h"
#include "smartmill_daq/instrument/instrument.h"

namespace smartmill::daq {
namespace {

YAML::Node channelNode(const YAML::Node& root, const std::string& topic, const std::string& name) {
  for (const YAML::Node& stream : root["streams"]) {
    if (stream["topic"].as<std::string>() != topic) continue;
    for (const YAML::Node& channel : stream["channels"]) {
      if (channel["name"].as<std::string>() == name) return channel;
    }
  }
  return {};
}

}  // namespace

void storeSensitivity(const std::string& file, const std::string& topic, const std::string& channel,
                      double sensitivity, double std_dev, const std::string& date) {
  readChannel(file, topic, channel);
  std::string text = readText(file);
  // The last key first, so that the places of the others stay.
  const std::vector<std::pair<const char*, std::string>> values{{"sensitivity_date", date},
                                                                {"sensitivity_std", yamlNumber(std_dev, 4)},
                                                                {"sensitivity", yamlNumber(sensitivity, 6)}};
  for (const auto& [key, value] : values) {
    setValue(text, channelNode(YAML::Load(text), topic, channel), key, value, "sensitivity");
  }
  const auto is_stored = [&] {
    return std::abs(readChannel(file, topic, channel).sensitivity / sensitivity - 1.0) < 1e-4;
  };
  writeChecked(file, text, is_stored,
               file + formatted(": the sensitivity of %s cannot be replaced here, expected sensitivity: %.6g",
                                channel.c_str(), sensitivity));
}

}  // namespace smartmill::daq
