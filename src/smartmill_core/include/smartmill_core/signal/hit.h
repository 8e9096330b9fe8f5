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

/// What makes a hit useless.
struct HitLimits {
  double weak_force = 20.0;  ///< [N] a peak below this is a weak hit, > 0
  double second_hit_share =
      0.1;                      ///< [1] a second peak above this share of the main one is a double hit, 0..1
  double response_range = 0.0;  ///< [unit of the response] a response reaching this is clipped; 0: unknown
};

/// Why a hit cannot be used.
struct HitFault {
  std::string text;       ///< one line; empty: the hit can be used
  bool bad_data = false;  ///< clipped, NaN, lost samples; otherwise the blow itself was weak or double
};
HitFault hitFault(const Hit& hit, const HitLimits& limits);

}  // namespace smartmill
