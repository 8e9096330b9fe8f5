#pragma once

#include <functional>
#include <set>
#include <utility>
#include <vector>

#include "modal_window.h"
#include "smartmill_core/modal/modal_estimate.h"

namespace smartmill {

/// Finds modes one after another in common lines: each in a window of its own with its neighbours, the others
/// taken off.
class ModalSearch {
 public:
  ModalSearch(const WeightedLines& lines, const ModalEstimateOptions& options);

  /// Starts with candidates together, neighbours with neighbours, and drops the weakest until all that stay
  /// are proven: in dense bands one mode alone proves nothing while the others are missing. @return false:
  /// cancelled
  bool startWith(std::vector<Pole> candidates);
  /// How many of these stand where no mode is proven.
  std::size_t unmet(const std::vector<Pole>& candidates) const;
  /// Goes on from where another search of the same lines stands.
  void goOnFrom(ModalSearch other);
  /// Tries candidates in the order of what each alone explains. @return false: cancelled
  bool addCandidates(std::vector<Pole> candidates);
  /// Tries where most is left.
  bool addLoudest(int rounds);
  /// Fits every mode again with its neighbours as they are now, and drops what is no longer proven.
  /// @param last with all lines and to the end
  bool settle(int sweeps, bool last);

  /// Peaks that stand clear of all about them while their phase tells of no mode (few lines on a peak, random
  /// excitation): a mode fitted to the logarithm of the magnitude.
  void addByMagnitude();

  std::size_t modes() const { return modes_.size(); }
  /// Those that are proven, or those that are not; lowest frequency first.
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
  bool taken(const Pole& p) const;
  void fitCluster(const std::vector<Pole>& cluster);
  void take(const std::vector<std::size_t>& members, const ModalWindow& window, const WindowFit& fit);
  void subtract(const EstimatedMode& mode, double sign);
  bool fitMagnitude(const std::vector<double>& magnitude, std::size_t peak);
  bool inBand(double frequency, double damping) const;
  double loudest() const;
  bool goOn(double share) const;

  const WeightedLines& lines_;
  const ModalEstimateOptions& options_;
  std::vector<std::vector<std::complex<double>>> left_;  // measured less all modes
  std::vector<EstimatedMode> modes_;
  std::vector<double> tried_;  // [Hz] where addLoudest() has been
};

}  // namespace smartmill
