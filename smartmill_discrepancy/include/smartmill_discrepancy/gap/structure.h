#pragma once

#include <vector>

#include "smartmill_discrepancy/gap/twin_runner.h"
#include "smartmill_discrepancy/results/finding.h"

namespace smartmill::discrepancy {

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

}  // namespace smartmill::discrepancy
