#include "smartmill_core/model/tool_files.h"

#include <algorithm>
#include <sstream>

#include "smartmill_core/error.h"

namespace smartmill {

ToolFile toolFileOf(const std::string& text) {
  constexpr std::size_t MOST_DIGITS = 4;
  const std::size_t equals = text.find('=');
  const std::string number = text.substr(0, equals);
  const bool numbered =
      equals != std::string::npos && !number.empty() && number.size() <= MOST_DIGITS &&
      std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; });
  if (!numbered) return {std::nullopt, text};
  return {std::stoi(number), text.substr(equals + 1)};
}

std::map<int, MachineModel> readToolModels(const std::string& text, const std::string& key) {
  std::map<int, MachineModel> models;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    const ToolFile tool = toolFileOf(word);
    if (tool.number.value_or(0) == 0)
      throw Error(key + ": " + word + ": expected N=FILE, the number of the tool and its model");
    if (!models.emplace(*tool.number, readMachineModel(tool.file)).second)
      throw Error(key + ": " + word + ": tool " + word.substr(0, word.find('=')) + " a second time");
  }
  return models;
}

}  // namespace smartmill
