#pragma once

#include <limits>
#include <string>

#include "smartmill_core/cutting/tool.h"

namespace smartmill {

/// NaN throughout.
inline constexpr CuttingCoefficients NOT_IDENTIFIED{
    std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN(),
    std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN(),
    std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};

/// Identified coefficients of a tool and material (topic material/coefficients). NaN: not identified.
struct CoefficientSet {
  double stamp = 0.0;  ///< [s] of the last test used
  std::string tool;
  std::string material;
  std::string source;  ///< load_meter or force
  CuttingCoefficients value;
  CuttingCoefficients std_dev;
  double friction_viscous = std::numeric_limits<double>::quiet_NaN();  ///< [N m s/rad]
  double friction_coulomb = std::numeric_limits<double>::quiet_NaN();  ///< [N m]
  int tests = 0;
};

}  // namespace smartmill
