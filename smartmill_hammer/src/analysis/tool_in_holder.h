#pragma once

#include <vector>

#include <Eigen/Core>

namespace smartmill::hammer {

/// A mode of spindle and holder with a rigid massless tool, at its tip.
struct SpindleMode {
  double frequency = 0.0;  ///< [Hz]
  double gain = 0.0;       ///< [m/N] static, at the tip
  double tilt = 0.0;       ///< [1/m] slope over deflection at the tip
};

/// A tool as a beam (Timoshenko elements) on a lateral and a rotational spring, whose base the spindle modes
/// move.
struct ToolInHolder {
  double young = 0.0, density = 0.0;                                                  // [N/m2], [kg/m3]
  double stickout = 0.0, diameter = 0.0, fluted_length = 0.0, fluted_diameter = 0.0;  // [m]
  double lateral_stiffness = 0.0, rotational_stiffness = 0.0;                         // [N/m], [N m/rad]
  std::vector<SpindleMode> spindle;
};

/// A mode of tool and spindle coupled.
struct HeldMode {
  double frequency = 0.0;     ///< [Hz]
  std::vector<double> shape;  ///< deflection [1/sqrt(kg)] and slope at each node, from the tip
  double element = 0.0;       ///< [m] from node to node

  double deflection(double height) const;         ///< [1/sqrt(kg)] deflection at a height [m] above the tip
  double gain(double struck, double read) const;  ///< [m/N] static
};

/// Modes of a tool in its holder, and to first order those of a slightly different one.
class HeldTool {
 public:
  explicit HeldTool(const ToolInHolder& tool);

  /// All modes of the elements, lowest first; empty for an invalid beam.
  const std::vector<HeldMode>& modes() const { return modes_; }
  /// In the same order. @param near with the same number of spindle modes; modes of equal frequency mix
  std::vector<HeldMode> modesOf(const ToolInHolder& near) const;

 private:
  HeldMode modeOf(double frequency, const Eigen::VectorXd& shape, double element) const;

  Eigen::MatrixXd mass_, stiffness_, shapes_;
  Eigen::VectorXd squares_;  // [rad2/s2]
  std::vector<HeldMode> modes_;
};

}  // namespace smartmill::hammer
