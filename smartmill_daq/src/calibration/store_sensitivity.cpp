#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_daq/calibration/sensitivity.h"
#include "smartmill_daq/instrument/instrument.h"

namespace smartmill::daq {
namespace {

/// Position of the text of a value in the file.
struct Place {
  std::size_t at = 0, length = 0;
};

YAML::Node channelNode(const YAML::Node& root, const std::string& topic, const std::string& name) {
  for (const YAML::Node& stream : root["streams"]) {
    if (stream["topic"].as<std::string>() != topic) continue;
    for (const YAML::Node& channel : stream["channels"]) {
      if (channel["name"].as<std::string>() == name) return channel;
    }
  }
  return {};
}

std::optional<Place> placeOf(const YAML::Node& channel, const char* key, const std::string& text) {
  const YAML::Node value = channel[key];
  if (!value) return std::nullopt;
  const auto at = static_cast<std::size_t>(value.Mark().pos);
  const std::size_t end = std::min(text.find_first_of(",}# \t\r\n", at), text.size());
  return Place{at, end - at};
}

}  // namespace

void storeSensitivity(const std::string& file, const std::string& topic, const std::string& channel,
                      double sensitivity, double std_dev, const std::string& date) {
  readChannel(file, topic, channel);
  const std::string original = readText(file);
  std::string text = original;
  // The last key first, so that the places of the others stay.
  const std::vector<std::pair<const char*, std::string>> values{{"sensitivity_date", date},
                                                                {"sensitivity_std", yamlNumber(std_dev, 4)},
                                                                {"sensitivity", yamlNumber(sensitivity, 6)}};
  for (const auto& [key, value] : values) {
    const YAML::Node node = channelNode(YAML::Load(text), topic, channel);
    if (const auto place = placeOf(node, key, text)) {
      text.replace(place->at, place->length, value);
      continue;
    }
    const Place after = *placeOf(node, "sensitivity", text);
    const bool flow = node.Style() == YAML::EmitterStyle::Flow;
    const std::string indent(static_cast<std::size_t>(node["sensitivity"].Mark().column) - 13, ' ');
    text.insert(after.at + after.length, (flow ? ", " : "\n" + indent) + key + ": " + value);
  }
  writeText(file, text);
  try {
    if (std::abs(readChannel(file, topic, channel).sensitivity / sensitivity - 1.0) < 1e-4) return;
  } catch (const Error&) {  // reported below
  }
  writeText(file, original);
  throw Error(file +
              formatted(": the sensitivity of %s cannot be replaced here, expected sensitivity: %.6g",  //
                        channel.c_str(), sensitivity));
}

}  // namespace smartmill::daq
