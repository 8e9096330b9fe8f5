#pragma once

#include <vector>

#include "residual_modes.h"

namespace smartmill {

/// Finds modes one after another in common lines: each in its own window with its neighbours, after
/// subtraction of the others.
class ModalSearch {
 public:
  ModalSearch(const WeightedLines& lines, const ModalEstimateOptions& options);

  /// Fits all candidates together, in groups of neighbours, and drops the weakest until all remaining ones
  /// are significant: in dense bands a single mode is not significant while the others are missing. @return
  /// false: cancelled
  bool startWith(std::vector<Pole> candidates);
  /// Number of candidates without a significant mode nearby.
  std::size_t countUnmatched(const std::vector<Pole>& candidates) const;
  /// Takes over the state of another search of the same lines.
  void continueFrom(ModalSearch other);
  /// Tries candidates in the order of the share that each explains alone. @return false: cancelled
  bool addCandidates(std::vector<Pole> candidates);
  /// Tries modes at the largest residual.
  bool addAtLargestResidual(int rounds);
  /// Refits every mode with its present neighbours, and drops modes that are no longer significant. @param
  /// last with all lines and to full convergence
  bool refitAll(int sweeps, bool last);

  ResidualModes& found() { return found_; }
  /// The significant modes, or the others; lowest frequency first.
  std::vector<EstimatedMode> results(bool proven) const;

 private:
  double score(const Pole& candidate) const;
  bool tryPole(double frequency, double damping);
  bool refit(const std::vector<std::size_t>& members, const EstimatedMode* more, bool last);
  Eigen::Index worst(const WindowFit& fit, double least) const;
  bool hasModeAt(const Pole& p) const;
  void fitCluster(const std::vector<Pole>& cluster);
  double frequencyOfLargestResidual() const;
  bool reportProgress(double share) const;

  const ModalEstimateOptions& options_;
  const ModalSearchOptions& search_;
  ResidualModes found_;
  std::vector<double> tried_frequencies_;  // [Hz] frequencies that addAtLargestResidual() has tried
};

}  // namespace smartmill
