#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cut_mechanics.h"
#include "smartmill_loadmeter/motor/force_estimate.h"

namespace smartmill::loadmeter {

/// Measurement: quantity of CutMechanics, value and total standard deviation.
struct ForceObservation {
  int quantity = 0;
  double value = 0.0, std_dev = 0.0;
  int drive = -1;  // axis of the drive whose motor constant and lag are unknowns; -1: none
  LagResponse lagResponse{};

  bool isLine() const { return quantity >= CutMechanics::LINES; }
};

/// Unknowns in addition to the coefficients: for each drive with lines, the logarithms of its motor constant
/// and bandwidth over their standard deviations.
struct DriveUnknowns {
  std::array<Eigen::Index, 3> at{{-1, -1, -1}};
  std::array<double, 3> gain_std{}, lag_std{};
  Eigen::Index count = 0;

  double predicted(const ForceObservation& row, const Eigen::VectorXd& expected,
                   const Eigen::VectorXd& unknowns) const;
};

/// Measurements of a cut with their systematic errors.
class ForceObservations {
 public:
  std::vector<ForceObservation> rows;
  std::vector<std::string> sources;
  DriveUnknowns drives;

  /// @param share relative systematic error of the sensor. @param size [N, N m] to which the share applies
  void add(const std::string& source, int quantity, const std::optional<Estimate>& e, double share,
           double size, double zero = 0.0);
  /// Adds the lines of the drive whose mean was added last.
  void addLines(int axis, const std::vector<SpectralLine>& lines, const Estimate& bandwidth,
                const ForceEstimateParameters& p);
};

/// @throws Error without measurements, or with one that has no standard deviation.
ForceObservations observationsOf(const CutMeasurements& r, const ForceEstimateParameters& p);

}  // namespace smartmill::loadmeter
