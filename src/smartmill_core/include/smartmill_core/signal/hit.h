#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace smartmill {

/// One recorded hit: hammer force and response, evenly sampled.
struct Hit {
  double stamp = 0.0;            ///< [s] of the trigger
  double sample_rate = 0.0;      ///< [Hz]
  std::size_t pre_trigger = 0;   ///< [1] samples before the trigger
  std::vector<double> force;     ///< [N]
  std::vector<double> response;  ///< [V], [m] or [m/s2]
};

/// Why a hit cannot be used (smartmill_core/modal/hit_check.h).
struct HitFault {
  std::string text;       ///< one line; empty: the hit can be used
  bool bad_data = false;  ///< clipped, NaN, lost samples; otherwise the hit itself was weak, dull or double
};

}  // namespace smartmill
