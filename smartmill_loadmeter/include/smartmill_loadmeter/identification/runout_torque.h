#pragma once

#include <array>
#include <vector>

#include "smartmill_core/cutting/tool.h"

namespace smartmill::loadmeter {

/// Torque per unit of Ktc and of Kte of a rigid tool whose axis runs out (effects.md): tooth t cuts at R + x
/// cos(position of t) + y sin(position of t). Closed form along the helix: between the angles at which
/// another earlier surface becomes the nearest, or the tooth leaves the material, h is a sine and a constant.
class RunoutTorque {
 public:
  /// @param x, y [m] offset cos(angle), offset sin(angle).
  RunoutTorque(const ToolGeometry& tool, const Engagement& engagement, double x, double y);

  /// @param spindle_angle [rad] of tooth 1 at its tip. @return {[m2], [m]} times radius: N m per N/m2, N/m.
  std::array<double, 2> at(double spindle_angle) const;
  /// Over a revolution.
  std::array<double, 2> mean() const;

 private:
  // h = slope sin(phi) + level from `from` to the next piece; without a cut both are empty.
  struct Piece {
    double from, slope, level;
    bool cuts;
    std::array<double, 2> before;  // integrals of h and of 1 up to `from`
  };
  std::array<double, 2> integral(const std::vector<Piece>& pieces, double phi) const;
  std::array<double, 2> density(const std::vector<Piece>& pieces, double phi) const;

  ToolGeometry tool_;
  double depth_;
  std::vector<double> tooth_angle_;
  std::vector<std::vector<Piece>> teeth_;
};

}  // namespace smartmill::loadmeter
