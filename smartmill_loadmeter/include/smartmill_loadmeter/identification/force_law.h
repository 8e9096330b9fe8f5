#pragma once

#include <array>
#include <string>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"

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
  ForceLawKind kind = ForceLawKind::linear;
  std::array<double, 3> value{};  ///< Kc [N/m2], Ke [N/m], knee [m]; power: force at 0.1 mm [N/m], q [1]
  std::array<double, 3> std_dev{};
  double bic = 0.0;              ///< lower is better
  double rms = 0.0;              ///< [N/m] of the residual
  double at(double chip) const;  ///< [N/m]
};

/// The three laws fitted to force against chip thickness, best first by the Bayesian information criterion.
/// @throws Error with fewer than 10 points.
std::vector<ForceLaw> fitForceLaws(const std::vector<double>& chip, const std::vector<double>& force);

/// Fit of whole revolutions of force by a rigid tool with runout and size effect, Kc (h / 0.1 mm)^-p.
struct SlotFitResult {
  std::string name;
  CuttingCoefficients value, std_dev;
  double size_exponent = 0.0, size_exponent_std = 0.0;  ///< [1]
  double offset = 0.0, offset_std = 0.0;                ///< [m] of the cutter axis
  double offset_angle = 0.0;                            ///< [rad] relative to tooth 1
  std::vector<double> phase;  ///< [rad] of each cut: spindle angle at its revolution's start
  double unbalance = 0.0;     ///< [N] force rotating with the tool
  double bic = 0.0;           ///< lower is better
  double rms = 0.0;           ///< [N] of the residual in the mean and the first orders
};

/// Fits the mean revolution of each cut of a campaign (fx, fy, fz at even angles, phases aligned by the fit)
/// with and without size effect, runout and unbalance, best first. Only the mean and the first teeth + 1
/// orders are compared, below the resonances of a force sensor. Without a tachometer the phase of each cut is
/// an unknown.
/// @throws Error with the file and what is missing.
std::vector<SlotFitResult> fitSlots(const Campaign& campaign, const MachineModel& model);

/// Force over chip thickness of all cuts in one list, from their mean revolutions at the phases of a fit.
/// @throws Error as forcePoints().
std::vector<ForcePoint> revolutionPoints(const Campaign& campaign, const MachineModel& model,
                                         const SlotFitResult& fit);

}  // namespace smartmill::loadmeter
