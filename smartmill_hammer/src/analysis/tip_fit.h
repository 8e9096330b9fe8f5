#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>
#include <vector>

#include <Eigen/Core>

#include "smartmill_hammer/analysis/tip_correction.h"
#include "tool_in_holder.h"

namespace smartmill::hammer {

/// Unknowns of a fit; three of each spindle mode follow, then the scale of each further measurement.
enum Unknown : Eigen::Index {
  YOUNG,
  DENSITY,
  STICKOUT,
  DIAMETER,
  FLUTED,
  RATIO,
  LATERAL,
  ROTATIONAL,
  HEIGHT,
  SHARED
};

/// Indices of the measured modes that are tool modes; each other one is a spindle mode.
using ToolModes = std::set<std::size_t>;

/// Measured modes, the beam that shall explain them, and the hypothesis which of them are tool modes.
struct TipProblem {
  const std::vector<OffsetMeasurement>& measurements;
  const ToolBeam& tool;
  const HolderPrior& prior;
  double high;
  const TipFitOptions& options;
  ToolModes of_tool;

  const std::vector<Mode>& modes() const { return measurements.front().modes.modes; }
  std::size_t spindleModes() const { return modes().size() - of_tool.size(); }
  /// Index of the scale of a further measurement over the first.
  Eigen::Index scaleOf(std::size_t measurement) const {
    return SHARED + static_cast<Eigen::Index>(3 * spindleModes() + measurement - 1);
  }
  Eigen::Index unknowns() const { return scaleOf(measurements.size()); }
  double shift(const Eigen::VectorXd& z) const { return prior.height * z[HEIGHT]; }
  double gainOf(const HeldMode& mode, const OffsetMeasurement& at, const Eigen::VectorXd& z) const {
    return mode.gain(at.struck + shift(z), at.read + shift(z));
  }
  double largestGain() const {
    double largest = 0.0;
    for (const Mode& m : modes()) largest = std::max(largest, std::abs(m.gain));
    return largest;
  }
};

/// Unknowns of least squares, with their covariance.
struct TipFit {
  Eigen::VectorXd z;
  Eigen::MatrixXd covariance;
  std::vector<std::size_t> match;  ///< for each measured mode the index of the model's mode
  double squares = INFINITY;       ///< infinite: no fit
};

/// Unknowns in standard deviations of their priors; frequencies and gains of the spindle modes as logarithms
/// over their starts.
ToolInHolder toolInHolder(const TipProblem& problem, const Eigen::VectorXd& z);

TipFit fitTip(const TipProblem& problem);

/// A standard deviation that is not known counts as none.
double finiteOrZero(double std);

}  // namespace smartmill::hammer
