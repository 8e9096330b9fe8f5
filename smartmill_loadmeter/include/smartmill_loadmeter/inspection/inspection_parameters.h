#pragma once

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::loadmeter {

/// Which measured dimensions of parts are usable, and for what.
struct InspectionParameters {
  double largest_difference = 1.0e-3;
  double outlier = 4.0;
  double temperature_std = 0.29;
  double least_temperature_spread = 5.0;

  void declare(ParameterTable& table) {
    table.number(
        "largest_difference", largest_difference, "m", Range::openLow(0.0, 0.1),
        "largest plausible difference between measured and nominal dimension; a larger one is a wrong "
        "feature or unit");
    table.number("outlier", outlier, "1", Range::closed(2.0, 20.0),
                 "standard deviations from the others at which a dimension is refused; noise alone exceeds 4 "
                 "once in 16,000");
    table.number("temperature_std", temperature_std, "K", Range::closed(0.0, 10.0),
                 "standard deviation of a temperature of the machine: 0.29 K by a resolution of 1 K");
    table.number("least_temperature_spread", least_temperature_spread, "K", Range::openLow(0.0, 100.0),
                 "between the lowest and the highest temperature, from which a thermal growth is estimated; "
                 "the resolution of the temperature then biases it by a few percent");
  }
};

}  // namespace smartmill::loadmeter
