#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "search/projection.h"

namespace smartmill::discrepancy {

struct ModeScanOptions {
  double low = 0.0, high = 0.0;  ///< [Hz] range of frequencies
  double ratio = 0.0;            ///< [1] of neighbouring frequencies, within the half-power width of a mode
  double damping_ratio = 0.0;    ///< [1] assumed; the fit finds the true one
  bool positive = false;         ///< whether only positive gains are possible
  std::size_t found = 2;         ///< best frequencies, of which the fit tries each
  double separation = 0.23;      ///< [1] least logarithm of their ratio: a third of an octave
};

/// First-order columns of a mode of unit gain, one per frequency [Hz].
using ModeColumns = std::function<Eigen::MatrixXd(const std::vector<double>& frequencies)>;

/// The best frequencies [Hz] of one more mode, best first.
std::vector<double> bestFrequencies(const Projection& projection, int threads, const ModeColumns& columns,
                                    const ModeScanOptions& options);

}  // namespace smartmill::discrepancy
