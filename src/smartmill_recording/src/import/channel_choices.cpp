// What the user states of channels.

#include <charconv>
#include <cmath>
#include <sstream>

#include "smartmill_core/campaign/record_columns.h"
#include "smartmill_core/error.h"
#include "smartmill_recording/import/channel_mapping.h"

namespace smartmill::recording {

void checkChoice(const std::string& place, const std::string& column, const ChannelChoice& choice) {
  if (!recordColumn(column)) {
    std::string names;
    for (const RecordColumn& known : RECORD_COLUMNS)
      names += (names.empty() ? "" : ", ") + std::string(known.name);
    throw Error(place + ": '" + column + "' is not a column; expected one of " + names);
  }
  if (choice.scale && !(std::isfinite(*choice.scale) && *choice.scale != 0.0))
    throw Error(place + ": the scale of " + column + " is not a number other than 0");
}

ChannelChoices channelChoices(const std::string& text) {
  ChannelChoices choices;
  std::istringstream list(text);
  for (std::string part; std::getline(list, part, ',');) {
    const std::size_t equals = part.find('=');
    if (equals == std::string::npos || equals == 0)
      throw Error("--channels: '" + part + "': COLUMN=NAME[UNIT]*SCALE expected");
    const std::string column = part.substr(0, equals);
    std::string rest = part.substr(equals + 1);
    ChannelChoice choice;
    const std::size_t star = rest.rfind('*');
    if (star != std::string::npos) {
      double scale = 0.0;
      const char* const last = rest.data() + rest.size();
      const auto [end, code] = std::from_chars(rest.data() + star + 1, last, scale);
      if (code != std::errc() || end != last)
        throw Error("--channels: '" + part + "': '" + rest.substr(star + 1) + "' is not a number");
      choice.scale = scale;
      rest.erase(star);
    }
    if (!rest.empty() && rest.back() == ']') {
      const std::size_t open = rest.rfind('[');
      if (open == std::string::npos)
        throw Error("--channels: '" + part + "': COLUMN=NAME[UNIT]*SCALE expected");
      choice.unit = rest.substr(open + 1, rest.size() - open - 2);
      rest.erase(open);
    }
    if (!rest.empty()) choice.name = rest;
    checkChoice("--channels", column, choice);
    if (!choices.emplace(column, choice).second) throw Error("--channels: " + column + " is stated twice");
  }
  return choices;
}

}  // namespace smartmill::recording
