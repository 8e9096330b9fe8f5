#pragma once

#include <vector>

#include <Eigen/Core>

namespace smartmill {
namespace hammer {

/// A mode of spindle and holder alone, as a rigid tool's tip would show it.
struct SpindleMode {
  double frequency = 0.0;  ///< [Hz]
  double gain = 0.0;       ///< [m/N] static, at the tip
  double tilt = 0.0;       ///< [1/m] slope over deflection at the tip
};

/// A tool as a beam (Timoshenko elements), held by a spring across and one against tilting in what the
/// spindle modes move.
struct ToolInHolder {
  double young = 0.0, density = 0.0;                                                  // [N/m2], [kg/m3]
  double stickout = 0.0, diameter = 0.0, fluted_length = 0.0, fluted_diameter = 0.0;  // [m]
  double across = 0.0, turning = 0.0;                                                 // [N/m], [N m/rad]
  std::vector<SpindleMode> spindle;
};

/// A mode of both together.
struct HeldMode {
  double frequency = 0.0;     ///< [Hz]
  std::vector<double> shape;  ///< deflection [1/sqrt(kg)] and slope at each node, from the tip
  double element = 0.0;       ///< [m] from node to node

  double at(double height) const;                 ///< deflection above the tip [m]
  double gain(double struck, double read) const;  ///< [m/N] static share
};

/// The modes of a tool in its holder, and, to first order, those of one that differs a little.
class HeldTool {
 public:
  explicit HeldTool(const ToolInHolder& tool);

  /// Lowest first, all that the elements have; empty when the beam is none.
  const std::vector<HeldMode>& modes() const { return modes_; }
  /// In the same order. Of the same spindle modes' number; modes of one frequency are not told apart.
  std::vector<HeldMode> modesOf(const ToolInHolder& near) const;

 private:
  HeldMode modeOf(double frequency, const Eigen::VectorXd& shape, double element) const;

  Eigen::MatrixXd mass_, stiffness_, shapes_;
  Eigen::VectorXd squares_;  // [rad2/s2]
  std::vector<HeldMode> modes_;
};

}  // namespace hammer
}  // namespace smartmill
