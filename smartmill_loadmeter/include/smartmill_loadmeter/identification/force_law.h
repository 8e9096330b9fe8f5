#pragma once

#include <array>
#include <string>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"

namespace smartmill::loadmeter {

/// Radial and tangential force per depth of cut at one chip thickness.
struct ForcePoint {
  double chip = 0.0;        ///< [m] nominal, f sin(phi)
  double tangential = 0.0;  ///< [N/m]
  double radial = 0.0;      ///< [N/m]
};

/// Bachrathy & Stepan section 4: measured Fx, Fy turned into the frame of the one edge in cut, (4.3); chip
/// thickness from the angle. Only angles at which one tooth cuts over its whole depth count: straight teeth,
/// or where the helix lag keeps within the engagement; a helical edge is taken at its mean lag.
/// @param spindle_angle [rad] of tooth 1, per sample. @throws Error when two teeth cut at once all the time.
std::vector<ForcePoint> forcePoints(const std::vector<double>& fx, const std::vector<double>& fy,
                                    const std::vector<double>& spindle_angle, const ToolGeometry& tool,
                                    const Engagement& engagement);

/// Force per depth as a function of chip thickness.
enum class ForceLawKind {
  linear,          ///< Kc h + Ke
  shifted_linear,  ///< Kc h + Ke above a knee; through zero below it (Shi and Tobias' straight parts)
  power            ///< K h^q, Kienzle
};
const char* nameOf(ForceLawKind kind);

struct ForceLaw {
  ForceLawKind kind = ForceLawKind::linear;
  std::array<double, 3> value{};  ///< Kc [N/m2], Ke [N/m], knee [m]; power: force at 0.1 mm [N/m], q [1]
  std::array<double, 3> std_dev{};
  double bic = 0.0;              ///< lower is better
  double rms = 0.0;              ///< [N/m] of what is left
  double at(double chip) const;  ///< [N/m]
};

/// The three laws fitted to force against chip thickness, best first by the Bayesian information criterion.
/// @throws Error with fewer than 10 points.
std::vector<ForceLaw> fitForceLaws(const std::vector<double>& chip, const std::vector<double>& force);

/// Fit of whole revolutions of force by a rigid tool with runout and size effect, Kc (h / 0.1 mm)^-p.
struct SlotFit {
  std::string name;
  CuttingCoefficients value, std_dev;
  double size_exponent = 0.0, size_exponent_std = 0.0;  ///< [1]
  double offset = 0.0, offset_std = 0.0;                ///< [m] of the cutter axis
  double offset_angle = 0.0;                            ///< [rad] against tooth 1
  std::vector<double> phase;  ///< [rad] of each cut: spindle angle at its revolution's start
  double unbalance = 0.0;     ///< [N] force that turns with the tool
  double bic = 0.0;           ///< lower is better
  double rms = 0.0;           ///< [N] of what is left in the mean and the first orders
};

/// Mean revolution of each cut of a campaign (fx, fy, fz at even angles, phase aligned between cuts by the
/// fit) fitted with and without size effect, runout and unbalance, best first. Compared in the mean and the
/// first teeth + 1 orders, below where a force sensor rings. Works without a tachometer: the phase of each
/// cut is an unknown.
/// @throws Error naming the file and what is missing.
std::vector<SlotFit> fitSlots(const Campaign& campaign, const MachineModel& model);

/// Force against chip thickness of all cuts in one list, from their mean revolutions at the phases of a fit.
/// @throws Error as forcePoints().
std::vector<ForcePoint> revolutionPoints(const Campaign& campaign, const MachineModel& model,
                                         const SlotFit& fit);

}  // namespace smartmill::loadmeter
