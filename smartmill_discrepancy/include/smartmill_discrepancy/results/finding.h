#pragma once

#include <map>
#include <string>
#include <vector>

namespace smartmill::discrepancy {

/// Significant component of the residual.
struct Finding {
  std::string channel;
  std::vector<std::string> tests;          ///< in which it is significant
  std::string domain;                      ///< order, frequency, level or time
  std::map<std::string, double> location;  ///< order; frequency_hz; time_s
  std::vector<std::string> depends_on;     ///< cutting, speed, chip_load, depth, immersion, time
  double share_of_gap = 0.0;               ///< [1] of all squares above the noise
  double p_value = 1.0;                    ///< after control of the false discovery rate
  double squares = 0.0;                    ///< of the component over the noise, all tests
  double amplitude = 0.0;                  ///< [unit of the channel] largest of the tests
};

}  // namespace smartmill::discrepancy
