#pragma once

#include <functional>
#include <set>
#include <utility>
#include <vector>

#include "modal_window.h"
#include "smartmill_core/modal/modal_estimate.h"

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

  /// Adds modes of clear peaks whose phase does not identify a mode (few lines on a peak, random excitation),
  /// fitted to the logarithm of the magnitude.
  void addByMagnitude();

  std::size_t modes() const { return modes_.size(); }
  /// The significant modes, or the others; lowest frequency first.
  std::vector<EstimatedMode> results(bool proven) const;

 private:
  struct Span {
    std::size_t first = 0, last = 0;
  };

  double reach(double frequency, double damping) const;
  Span spanOf(const std::vector<EstimatedMode>& members) const;
  std::vector<std::size_t> neighbours(double frequency, double damping) const;
  WeightedLines window(const Span& span, const std::vector<std::size_t>& members) const;
  WeightedLines cut(const std::vector<EstimatedMode>& all, const std::vector<std::size_t>& members,
                    double lines_a_half_width) const;
  double score(const Pole& candidate) const;
  bool tryPole(double frequency, double damping);
  bool refit(const std::vector<std::size_t>& members, const EstimatedMode* more, bool last);
  Eigen::Index worst(const WindowFit& fit, double least) const;
  bool hasModeAt(const Pole& p) const;
  void fitCluster(const std::vector<Pole>& cluster);
  void replaceModes(const std::vector<std::size_t>& members, const ModalWindow& window, const WindowFit& fit);
  void subtract(const EstimatedMode& mode, double sign);
  bool fitMagnitude(const std::vector<double>& magnitude, std::size_t peak);
  bool inBand(double frequency, double damping) const;
  double frequencyOfLargestResidual() const;
  bool reportProgress(double share) const;

  const WeightedLines& lines_;
  const ModalEstimateOptions& options_;
  std::vector<std::vector<std::complex<double>>> residual_;  // measured minus all modes
  std::vector<EstimatedMode> modes_;
  std::vector<double> tried_frequencies_;  // [Hz] frequencies that addAtLargestResidual() has tried
};

}  // namespace smartmill
