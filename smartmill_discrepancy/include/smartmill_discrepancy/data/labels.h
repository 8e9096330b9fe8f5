#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// Wrong labels of a campaign, one line each, e.g. "fx and fy look swapped in tests slot_1, slot_2".
struct Labels {
  std::vector<std::string> wrong;  ///< swapped channels, wrong unit, wrong spindle speed
  /// Tests that another test's label fits better. A missing effect that acts in one test looks the same: see
  /// doubtfulLabels().
  std::vector<std::string> doubtful;
};

/// Limits far beyond any effect of the catalogue.
struct LabelOptions {
  double doubtful_gap = 5.0;  ///< squares over the noise above which a label is doubtful
  double swapped = 0.1;       ///< [1] of the squares: maximum after a swap of channels
  double relabelled = 0.35;   ///< [1] of the squares: maximum with another test's label
  double comparable = 1.5;    ///< [1] maximum ratio of these squares to those of the label's own test
  double small_gap = 6.0;     ///< [N2] squares of a label's own test that count as this many at least
  double unusual = 3.0;       ///< [1] minimum ratio of a cut's squares to the median of all cuts
  std::size_t min_cuts = 4;   ///< from which on a median means something
  double speed = 0.02;        ///< [1] error of a stated spindle speed
  double unit_factor = 30.0;  ///< [1] factor beyond any gain error, below that of N and kN
  double min_signal = 100.0;  ///< [1] squares over the noise from which a factor below one is known
  double inverted = 0.5;      ///< [1] minimum squared correlation with the negative model
};

/// Compares with the nominal model; detects only errors far larger than any effect of the catalogue.
Labels checkLabels(const Dataset& data, int threads, const LabelOptions& limits = {});

/// Labels::doubtful with a model that includes the effects found: labels that stay doubtful are wrong.
std::vector<std::string> doubtfulLabels(const MachineModel& model, const Dataset& data, int threads,
                                        const LabelOptions& limits = {});

}  // namespace smartmill::discrepancy
