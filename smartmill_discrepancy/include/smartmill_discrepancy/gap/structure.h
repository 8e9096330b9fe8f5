#pragma once

#include <map>
#include <string>
#include <vector>

#include "smartmill_discrepancy/gap/twin_runner.h"

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

struct StructureOptions {
  int most = 12;                ///< findings
  double p_value = 1e-6;        ///< false discovery rate
  double twin_accuracy = 2e-4;  ///< [1] of the signal, below which the twin is not believed
  double squares_of_gap =
      0.0;  ///< what share_of_gap refers to; 0: the residual's own squares above the noise
  double least_share =
      0.005;  ///< squares of a finding over the samples of its channel, below which twin and record agree
};

/// Takes the residual apart, channel by channel: mean level, trend over the record, lines at orders of the
/// spindle, lines at fixed frequencies, each the strongest first, until what is left cannot be told from
/// noise (Benjamini-Hochberg over all looks).
/// @param residual over noise, laid out as the runner's vectors
std::vector<Finding> findStructure(const TwinRunner& runner, const std::vector<double>& residual,
                                   const StructureOptions& options);

/// Upper tail of the chi-square distribution with an even number of degrees of freedom, not below 1e-300.
double chiSquareTail(double value, std::size_t freedom);

/// Benjamini-Hochberg: p-values adjusted to false discovery rates, in the given order.
std::vector<double> falseDiscoveryRates(const std::vector<double>& p_values);

}  // namespace smartmill::discrepancy
