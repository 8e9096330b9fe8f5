#include "smartmill_launch/discovery/believed_limits.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include "smartmill_core/io/csv.h"
#include "smartmill_core/units.h"

namespace smartmill::discovery {

BelievedLimits::BelievedLimits(const std::string& chart, double share) {
  CsvReader csv(chart);
  std::vector<std::string_view> cells;
  if (!csv.next(&cells) || cells.size() < 2 || cells[0] != "rpm" || cells[1] != "limit_mm")
    csv.fail("expected the columns rpm, limit_mm of a chart");
  while (csv.nextFilled(&cells)) {
    if (cells.size() < 2) csv.fail("expected the columns rpm, limit_mm of a chart");
    if (cells[1].empty()) continue;  // stable to the largest depth
    limits_.push_back({units::radPerSecFromRpm(csv.number(cells[0], "rpm")),
                       share * csv.number(cells[1], "limit_mm") * units::MM});
  }
}

double BelievedLimits::depthAt(double speed) const {
  constexpr double NEAR = 0.02;  // [1] frequencies of the model and of the spindle's modes at speed
  double depth = std::numeric_limits<double>::infinity();
  for (const Limit& limit : limits_) {
    if (std::abs(limit.speed - speed) <= NEAR * speed) depth = std::min(depth, limit.depth);
  }
  return depth;
}

}  // namespace smartmill::discovery
