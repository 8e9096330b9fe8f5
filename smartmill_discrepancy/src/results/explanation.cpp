#include "smartmill_discrepancy/results/explanation.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace smartmill::discrepancy {

const char* nameOf(Verdict verdict) {
  static const std::array<const char*, 5> NAMES{
      {"no_disagreement", "explained", "partly_explained", "unknown_effect", "recalibrated"}};
  return NAMES.at(static_cast<std::size_t>(verdict));
}

bool standsFor(const Explanation& explanation, const std::string& named, const std::string& other) {
  const auto has = [](const std::vector<std::string>& group, const std::string& name) {
    return std::find(group.begin(), group.end(), name) != group.end();
  };
  return named == other ||
         std::any_of(explanation.not_separable.begin(), explanation.not_separable.end(),
                     [&](const auto& group) { return has(group, named) && has(group, other); });
}

}  // namespace smartmill::discrepancy
