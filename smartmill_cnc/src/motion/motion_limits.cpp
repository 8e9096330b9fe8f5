#include "smartmill_cnc/motion/motion_limits.h"

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/require.h"

namespace smartmill::cnc {

namespace {

std::string number(double value) {
  return formatted("%.6g", value);
}

}  // namespace

void MotionLimits::validate() const {
  for (std::size_t i = 0; i < 3; ++i) {
    if (!(travel[i][0] < travel[i][1])) {
      throw Error(std::string("travel_") + "xyz"[i] + ": [" + number(travel[i][0]) + ", " +
                  number(travel[i][1]) + "] m: expected the lower limit first");
    }
  }
  require("max_feed", max_feed, Range::positive(), "m/s");
  require("max_spindle_speed", max_spindle_speed, Range::positive(), "rad/s");
  checkBounds(*this);
}

}  // namespace smartmill::cnc
