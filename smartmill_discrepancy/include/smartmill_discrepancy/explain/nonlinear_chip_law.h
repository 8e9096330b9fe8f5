#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_discrepancy/fit/fit.h"

namespace smartmill::discrepancy {

/// Deviation of a revolution table from its linear dependence on the feed: cosine and sine of each order of
/// each force channel at several feeds per tooth; zero at the first and the last feed.
struct FeedCurvature {
  std::vector<double> chips;                                            ///< [m] ascending
  std::map<double, std::map<std::string, std::vector<double>>> orders;  ///< [N] two values per feed

  /// Cosine (or mean) and sine of an order [N], linearly interpolated over the feed.
  std::array<double, 2> at(double order, const std::string& channel, double chip) const;
};

/// Dependence of a cutting force on the chip thickness h.
struct ChipLaw {
  double exponent = 0.0;    ///< chip coefficients are proportional to h^-exponent
  double onset = 0.0;       ///< [m] edge coefficients are proportional to 1 - exp(-h / onset); 0: constant
  double edge_share = 1.0;  ///< [1] factor on the model's edge coefficients

  bool isNonlinear() const { return exponent > 0.0 || onset > 0.0; }
};

/// Force law with curvature over chip thickness, identified through an unknown linear sensor.
struct NonlinearChipLaw {
  ChipLaw in_plane;      ///< of tangential and radial forces, which fx and fy combine
  ChipLaw axial;         ///< equal to in_plane unless the lines of fz require a separate law
  double squares = 0.0;  ///< residual squares of the lines, each record weighted by its asynchronous part
  double linear_squares = 0.0;      ///< the same for the law linear in chip thickness
  double line_count = 0.0;          ///< [1] real values compared
  std::vector<double> phase_shift;  ///< [rad] by test of the runner
  FeedCurvature curvature;          ///< of the sensor's response, in addition to the model's own law

  bool isNonlinear() const { return in_plane.isNonlinear() || axial.isNonlinear(); }
  /// Reduction of the squares that justifies a separate law.
  double requiredReduction() const;
};

/// Grid of laws. An edge force with an onset far below the least feed is constant, one far above the largest
/// feed is a chip force.
struct ChipLawOptions {
  /// [1] of the size effect; the first is that of the linear law.
  std::vector<double> exponents{0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  std::vector<double> onsets{0.0, 0.04, 0.08, 0.12, 0.16, 0.24, 0.32};  ///< [1] of the largest feed
  /// [1] of the model's edge force
  std::vector<double> edge_shares{0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5};
  int sweeps = 5;          ///< alternations between axial and in-plane law at most
  std::size_t feeds = 11;  ///< of the curvature table, which is linear between them
};

/// Identifies force law and sensor together from cuts that differ in feed only. Behind a linear sensor each
/// tooth passing line is the line of the law times one gain that does not depend on the feed. The law is
/// chosen from a grid by the fitted cuts with the best gains; each record is weighted by its asynchronous
/// part. Phases of records without measured angle are estimated too: without a law a phase error that grows
/// with the feed would be taken for a trend of the lines.
/// @param cuts of the runner, at least three feeds @param nominal model with even pitch @param model current
/// model; the curvature is relative to it
/// @return nothing if the lines cannot be estimated or the model has a nonlinear law already
std::optional<NonlinearChipLaw> identifyChipLaw(const TwinRunner& runner,
                                                const std::vector<std::size_t>& cuts,
                                                const MachineModel& nominal, const MachineModel& model,
                                                const ChipLawOptions& options = {});

}  // namespace smartmill::discrepancy
