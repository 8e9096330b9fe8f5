#include "smartmill_program/live/condition_names.h"

#include <algorithm>

namespace smartmill::program {
namespace {

constexpr const char* NUMBER = " T";  // before it

}  // namespace

std::string toolName(const std::string& tool, int number, bool several) {
  return several ? tool + NUMBER + std::to_string(number) : tool;
}

int toolNumberOf(const std::string& name) {
  constexpr std::size_t MOST_DIGITS = 4;
  const std::size_t at = name.rfind(NUMBER);
  if (at == std::string::npos) return 0;
  const std::string digits = name.substr(at + 2);
  const bool number = !digits.empty() && digits.size() <= MOST_DIGITS &&
                      std::all_of(digits.begin(), digits.end(), [](char c) { return c >= '0' && c <= '9'; });
  return number ? std::stoi(digits) : 0;
}

}  // namespace smartmill::program
