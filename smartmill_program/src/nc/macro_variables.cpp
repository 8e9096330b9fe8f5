#include "macro_variables.h"

#include <string>

#include "smartmill_core/error.h"

namespace smartmill::program {

void MacroVariables::check(int number, int least) {
  const bool known = (number >= least && number <= LOCALS) || (number >= 100 && number <= 199) ||
                     (number >= 500 && number <= 999);
  if (!known)
    throw Error("#" + std::to_string(number) +
                " is not supported, expected #1 to #33, #100 to #199 or #500 to #999");
}

std::optional<double> MacroVariables::value(int number) const {
  check(number, 0);
  if (number <= LOCALS) return locals_.back()[static_cast<std::size_t>(number)];
  const auto found = common_.find(number);
  return found == common_.end() ? std::nullopt : std::optional<double>(found->second);
}

void MacroVariables::set(int number, std::optional<double> value) {
  check(number, 1);
  if (number <= LOCALS) {
    locals_.back()[static_cast<std::size_t>(number)] = value;
  } else if (value) {
    common_[number] = *value;
  } else {
    common_.erase(number);
  }
}

}  // namespace smartmill::program
