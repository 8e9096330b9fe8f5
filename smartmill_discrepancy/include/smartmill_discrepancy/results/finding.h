#pragma once

#include <map>
#include <string>
#include <vector>

namespace smartmill::discrepancy {

/// Something in the residual that is no noise.
struct Finding {
  std::string channel;
  std::vector<std::string> tests;          ///< where it is significant
  std::string domain;                      ///< order, frequency, level or time
  std::map<std::string, double> location;  ///< order; frequency_hz; time_s
  std::vector<std::string> depends_on;     ///< cutting, speed, chip_load, depth, immersion, time
  double share_of_gap = 0.0;               ///< [1] of all squares above the noise
  double p_value = 1.0;                    ///< after control of false discovery over all looks
  double squares = 0.0;                    ///< sum of squares over noise that it takes, all tests
  double amplitude = 0.0;                  ///< [unit of the channel] largest over the tests
};

}  // namespace smartmill::discrepancy
