#include "smartmill_hammer/analysis/offset_factor.h"

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"

namespace smartmill::hammer {

double offsetFactor(double stickout, double offset) {
  if (!(offset >= 0.0 && offset < stickout)) {
    throw Error(formatted(
        "offset correction: hammer offset %.2f mm: expected 0 up to less than the stick-out, %.2f mm",
        1e3 * offset, 1e3 * stickout));
  }
  const double l = stickout - offset;
  return 2.0 * stickout * stickout * stickout / (l * l * (3.0 * stickout - l));
}

}  // namespace smartmill::hammer
