#pragma once

#include <vector>

#include "smartmill_discrepancy/gap/twin_runner.h"
#include "smartmill_discrepancy/results/finding.h"

namespace smartmill::discrepancy {

struct StructureOptions {
  int most = 12;                ///< findings per channel
  double p_value = 1e-6;        ///< limit of the false discovery rate
  double twin_accuracy = 2e-4;  ///< [1] of the signal: smaller residuals are errors of the twin
  double squares_of_gap = 0.0;  ///< reference of share_of_gap; 0: squares of the residual above the noise
  double min_share = 0.005;     ///< minimum squares of a finding over the samples of its channel
};

/// Decomposes the residual channel by channel into mean, trend, decay, orders of the spindle and fixed
/// frequencies, the strongest component first, until the rest is noise (Benjamini-Hochberg over all trials).
/// @param residual over noise, in the layout of the runner's vectors
std::vector<Finding> findStructure(const TwinRunner& runner, const std::vector<double>& residual,
                                   const StructureOptions& options);

}  // namespace smartmill::discrepancy
