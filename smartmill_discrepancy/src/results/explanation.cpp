#include "smartmill_discrepancy/results/explanation.h"

#include <array>
#include <cstddef>

namespace smartmill::discrepancy {

const char* nameOf(Verdict verdict) {
  static const std::array<const char*, 5> NAMES{
      {"no_disagreement", "explained", "partly_explained", "unknown_effect", "recalibrated"}};
  return NAMES.at(static_cast<std::size_t>(verdict));
}

}  // namespace smartmill::discrepancy
