#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_discrepancy/gap/twin_runner.h"
#include "smartmill_discrepancy/results/finding.h"

namespace smartmill::discrepancy {

/// Components that are tried on a residual.
struct ComponentOptions {
  std::size_t orders = 36;      ///< of the spindle: several tooth passing orders
  std::size_t half_orders = 4;  ///< 0.5, 1.5, ...: patterns over two revolutions
  /// [s] time constants of a decay from the start of a record
  std::vector<double> decays{0.02, 0.035, 0.06, 0.1};
  double highest_order = 0.45;       ///< [1] of the sample rate
  std::size_t spectrum = 1u << 16u;  ///< [samples] to which records are padded for a common frequency grid
  std::size_t min_samples = 32;      ///< of a segment
};

struct StructureOptions {
  int most = 12;                         ///< findings per channel
  double p_value = 1e-6;                 ///< limit of the false discovery rate
  double twin_accuracy = TWIN_ACCURACY;  ///< [1] of the signal: smaller residuals are errors of the twin
  double squares_of_gap = 0.0;    ///< reference of share_of_gap; 0: squares of the residual above the noise
  double min_share = 0.005;       ///< minimum squares of a finding over the samples of its channel
  double min_slow_squares = 2.0;  ///< the same per slow mean: these are few
  ComponentOptions components = {};
};

/// Decomposes the residual channel by channel into mean, trend, decay, orders of the spindle and fixed
/// frequencies, the strongest component first, until the rest is noise (Benjamini-Hochberg over all trials).
/// @param residual over noise, in the layout of the runner's vectors
std::vector<Finding> findStructure(const TwinRunner& runner, const std::vector<double>& residual,
                                   const StructureOptions& options);

}  // namespace smartmill::discrepancy
