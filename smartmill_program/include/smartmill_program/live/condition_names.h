#pragma once

#include <string>

namespace smartmill::program {

/// What conditions state in addition to the engagement.
struct ConditionNames {
  std::string tool, material;
};

/// Name of a tool in conditions and results. @param number T @param several whether the program has others
std::string toolName(const std::string& tool, int number, bool several);

/// The T of a name that toolName() has made for one of several tools; 0: none.
int toolNumberOf(const std::string& name);

}  // namespace smartmill::program
