#include "smartmill_launch/comparison/offline_comparison.h"

#include <algorithm>
#include <cmath>

namespace smartmill::report {

void Agreement::add(const std::vector<double>& live, const std::vector<double>& offline) {
  const std::size_t common = std::min(live.size(), offline.size());
  missing += std::max(live.size(), offline.size()) - common;
  double scale = 0.0, difference = 0.0;
  for (std::size_t i = 0; i < common; ++i) {
    const bool numbers = std::isfinite(live[i]) && std::isfinite(offline[i]);
    if (!numbers) {
      if (std::isfinite(live[i]) != std::isfinite(offline[i])) ++missing;
      continue;
    }
    ++compared;
    scale = std::max(scale, std::abs(live[i]));
    difference = std::max(difference, std::abs(live[i] - offline[i]));
  }
  if (difference > 0.0) {
    largest = std::max(largest, scale > 0.0 ? difference / scale : std::numeric_limits<double>::infinity());
  }
}

}  // namespace smartmill::report
