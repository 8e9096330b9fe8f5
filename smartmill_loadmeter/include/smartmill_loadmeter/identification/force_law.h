#pragma once

#include <array>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"

namespace smartmill::loadmeter {

/// Tangential and radial force per depth of cut at one chip thickness.
struct ForcePoint {
  double chip = 0.0;        ///< [m] nominal, f sin(phi)
  double tangential = 0.0;  ///< [N/m]
  double radial = 0.0;      ///< [N/m]
};

/// Transforms measured Fx, Fy into the frame of the edge in cut (Bachrathy & Stepan, section 4, eq. 4.3),
/// with the chip thickness from the angle. Only angles with a single tooth in cut over its whole depth are
/// used: straight teeth, or a helix lag within the engagement; a helical edge is evaluated at its mean lag.
/// @param spindle_angle [rad] of tooth 1, per sample. @throws Error when two teeth always cut together.
std::vector<ForcePoint> forcePoints(const std::vector<double>& fx, const std::vector<double>& fy,
                                    const std::vector<double>& spindle_angle, const ToolGeometry& tool,
                                    const Engagement& engagement);

/// Force per depth as a function of chip thickness.
enum class ForceLawKind {
  linear,          ///< Kc h + Ke
  shifted_linear,  ///< Kc h + Ke above a knee, a line through zero below it (Shi and Tobias)
  power            ///< K h^q, Kienzle
};
const char* nameOf(ForceLawKind kind);

struct ForceLaw {
  static constexpr double REFERENCE_CHIP = 1e-4;  ///< [m] of the power law, a usual feed per tooth

  ForceLawKind kind = ForceLawKind::linear;
  std::array<double, 3>
      value{};  ///< Kc [N/m2], Ke [N/m], knee [m]; power: force at REFERENCE_CHIP [N/m], q [1]
  std::array<double, 3> std_dev{};
  double bic = 0.0;              ///< lower is better
  double rms = 0.0;              ///< [N/m] of the residual
  double at(double chip) const;  ///< [N/m]
};

/// The three laws fitted to force against chip thickness, best first by the Bayesian information criterion.
/// @throws Error with fewer than 10 points.
std::vector<ForceLaw> fitForceLaws(const std::vector<double>& chip, const std::vector<double>& force);

}  // namespace smartmill::loadmeter
