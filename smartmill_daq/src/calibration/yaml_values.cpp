#include "calibration/yaml_values.h"

#include <algorithm>
#include <optional>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"

namespace smartmill::daq {
namespace {

/// Position of the text of a value in the file.
struct Place {
  std::size_t at = 0, length = 0;
};

std::optional<Place> placeOf(const YAML::Node& map, const std::string& key, const std::string& text) {
  const YAML::Node value = map[key];
  if (!value) return std::nullopt;
  const auto at = static_cast<std::size_t>(value.Mark().pos);
  const std::size_t end = std::min(text.find_first_of(",}# \t\r\n", at), text.size());
  return Place{at, end - at};
}

}  // namespace

void setValue(std::string& text, const YAML::Node& map, const std::string& key, const std::string& value,
              const std::string& after) {
  if (const auto place = placeOf(map, key, text)) {
    text.replace(place->at, place->length, value);
    return;
  }
  const Place neighbour = *placeOf(map, after, text);
  const std::size_t end = neighbour.at + neighbour.length;
  if (map.Style() == YAML::EmitterStyle::Flow) {
    text.insert(end, ", " + key + ": " + value);
    return;
  }
  // The value of the neighbour begins behind its key, a colon and a blank; its comment stays on its line.
  const std::string indent(static_cast<std::size_t>(map[after].Mark().column) - after.size() - 2, ' ');
  text.insert(std::min(text.find('\n', end), text.size()), "\n" + indent + key + ": " + value);
}

void writeChecked(const std::string& file, const std::string& text, const std::function<bool()>& is_stored,
                  const std::string& fault) {
  const std::string original = readText(file);
  writeText(file, text);
  try {
    if (is_stored()) return;
  } catch (const Error&) {  // reported below
  }
  writeText(file, original);
  throw Error(fault);
}

}  // namespace smartmill::daq
