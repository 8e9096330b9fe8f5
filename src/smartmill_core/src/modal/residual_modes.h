#pragma once

#include <algorithm>
#include <complex>
#include <utility>
#include <vector>

#include "modal_window.h"
#include "smartmill_core/modal/modal_estimate.h"

namespace smartmill {

/// Lines first .. last - 1.
struct LineSpan {
  std::size_t first = 0, last = 0;
};

/// Mode k of a fit, with standard deviations and evidence.
EstimatedMode describeMode(const ModalWindow& window, const WindowFit& fit, Eigen::Index k);

/// The modes found so far in common lines and the residual, the lines minus all of these modes; cuts windows
/// out of the residual.
class ResidualModes {
 public:
  ResidualModes(const WeightedLines& lines, const ModalSearchOptions& options)
      : lines_(lines), options_(options), residual_(lines.value) {}

  const WeightedLines& lines() const { return lines_; }
  const std::vector<EstimatedMode>& modes() const { return modes_; }
  const std::vector<std::vector<std::complex<double>>>& residual() const { return residual_; }
  void continueFrom(ResidualModes other);

  /// [Hz] of a window on either side of a mode.
  double reach(double frequency, double damping) const;
  /// Whether a mode is far enough from the ends of the band.
  bool inBand(double frequency, double damping) const;
  LineSpan spanOf(const std::vector<EstimatedMode>& members) const;
  /// Modes that are fitted together with one here.
  std::vector<std::size_t> neighbours(double frequency, double damping) const;
  /// Lines of a span: the residual plus the responses of the members.
  WeightedLines window(const LineSpan& span, const std::vector<std::size_t>& members) const;
  /// Window around modes, averaged to a number of lines per half width of the narrowest.
  WeightedLines cut(const std::vector<EstimatedMode>& all, const std::vector<std::size_t>& members,
                    double lines_a_half_width) const;

  /// Replaces the members by the modes of a fit.
  void replace(const std::vector<std::size_t>& members, const ModalWindow& window, const WindowFit& fit);
  /// Replaces the modes for which `here` is true by one that was fitted to the magnitude; the residual stays.
  template <class Here>
  void replaceByMagnitude(const Here& here, const EstimatedMode& mode) {
    modes_.erase(std::remove_if(modes_.begin(), modes_.end(), here), modes_.end());
    modes_.push_back(mode);
  }

 private:
  void subtract(const EstimatedMode& mode, double sign);

  const WeightedLines& lines_;
  const ModalSearchOptions& options_;
  std::vector<std::vector<std::complex<double>>> residual_;
  std::vector<EstimatedMode> modes_;
};

}  // namespace smartmill
