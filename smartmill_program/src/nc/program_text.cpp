#include "program_text.h"

#include <sstream>

#include "block.h"
#include "smartmill_core/error.h"

namespace smartmill::program {

ProgramText::ProgramText(const std::string& text, const std::string& name) {
  std::istringstream in(text);
  int marks = 0;
  for (std::string line; marks < 2 && std::getline(in, line);) {
    lines_.push_back(line);
    if (isTapeMark(line)) {
      ++marks;
      lines_.back().clear();
      continue;
    }
    std::optional<int> number;
    try {
      number = programNumber(line);
    } catch (const Error& error) {
      throw Error(name + ": line " + std::to_string(lines_.size()) + ", " + error.what());
    }
    if (!number) continue;
    if (!numbers_.emplace(*number, lines_.size() - 1).second)
      throw Error(name + ": line " + std::to_string(lines_.size()) + ": program O" + std::to_string(*number) +
                  " a second time, expected each number once");
    starts_.emplace(lines_.size() - 1, *number);
  }
}

std::optional<std::size_t> ProgramText::find(int number) const {
  const auto found = numbers_.find(number);
  return found == numbers_.end() ? std::nullopt : std::optional<std::size_t>(found->second);
}

}  // namespace smartmill::program
