#pragma once

#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"

namespace smartmill::loadmeter {

/// Imperfections of a case; zero: off.
struct Faults {
  double resolution = 3e-4;       ///< [V] of the load meter
  double noise = 2e-4;            ///< [V] RMS before rounding
  double bandwidth = 7.0;         ///< [Hz]
  double depth_error = 0.02;      ///< [1] standard deviation of the axial depth, common to all cuts of a case
  double gain_error = 0.0;        ///< [1] standard deviation of load_meter_v_per_w
  bool stribeck = true;           ///< breakaway of 0.1..0.6 N m, to 1000..3000 rpm
  bool warmup = true;             ///< 10..40 % more friction when cold, time constant 200..1200 s
  double largest_runout = 12e-6;  ///< [m] offset is drawn from 0 to this
};

/// One machine, tool and material, drawn at random, with its air cuts and slots.
struct MachineCase {
  MachineModel model;  ///< stated values: load meter, nominal friction, tool
  CuttingCoefficients truth;
  double depth = 0.0;  ///< [1] relative error of the axial depth of all its cuts
  std::vector<TestRecord> tests;
};

/// Air cuts at ten speeds, then slots at four feeds and two speeds; the tool enters after 0.4 s of idling.
MachineCase drawCase(unsigned seed, const Faults& faults);

/// Torque of a rigid tool over one revolution with cutter-axis offset, at even angles: h of a tooth is the
/// least distance to the surface left by any earlier tooth (effects.md, runout); helix in slices.
std::vector<double> torqueOverARevolution(const ToolGeometry& tool, const Engagement& engagement,
                                          const CuttingCoefficients& k, double offset, double angle,
                                          std::size_t steps);

/// Errors of Ktc and Kte against the truth, relative.
struct CaseErrors {
  double thesis_ktc, thesis_kte;  ///< [1] procedure of the thesis (eq. 3.5..3.19)
  double ktc, kte;                ///< [1] this package
  double z_ktc, z_kte;            ///< [1] error over stated standard deviation
  double z_beside_depth;          ///< [1] of Ktc, without the depth error in error and standard deviation
  double depth;                   ///< [1] drawn error of the depth
  std::vector<std::string> terms;
};
CaseErrors judge(const MachineCase& one, const Faults& faults);

}  // namespace smartmill::loadmeter
