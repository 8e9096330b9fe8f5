#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

/// Force over a revolution: x, y, z [N] in even bins of the spindle angle.
struct RevolutionForce {
  static constexpr std::size_t ANGLES = 48;  ///< 16 for each tooth of three

  static double angle(std::size_t bin) {  ///< [rad] of the middle of a bin
    return units::TWO_PI * (static_cast<double>(bin) + 0.5) / static_cast<double>(ANGLES);
  }
  static std::size_t binOf(double revolutions) {  ///< @param revolutions [1], 0..1
    return std::min(ANGLES - 1, static_cast<std::size_t>(revolutions * static_cast<double>(ANGLES)));
  }

  std::array<std::array<double, ANGLES>, 3> axis{};
};

/// Mean revolution of one cut.
struct CutRevolution {
  Engagement engagement;
  RevolutionForce force;
};
/// @throws Error with the file when the record has less than a revolution in cut or too few samples.
CutRevolution revolutionOf(const CampaignTest& test, const Record& record);

/// Mean and cosine and sine components of the first orders, RMS-weighted: not distorted by the resonances of
/// a sensor. @return number of values written.
std::size_t lowOrders(const RevolutionForce& force, int orders, double* out);

}  // namespace smartmill::loadmeter
