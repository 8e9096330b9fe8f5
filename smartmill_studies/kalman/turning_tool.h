#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_kalman/in_cut/cutting_frf.h"
#include "smartmill_sim/twin/turning_spindle.h"

namespace smartmill::kalman {

/// Cuts on a simulated machine with speed-dependent modes of the tool.
struct TurningToolCase {
  MachineModel model;  ///< at speed zero, with runout among its effects
  sim::TurningSpindle spindle;
  std::vector<double> speeds;                       ///< [rad/s] centre speeds of the groups of cuts
  int cuts = 9;                                     ///< per group, evenly over +-width
  double width = 0.06;                              ///< [1] of speed
  double duration = 0.4;                            ///< [s] of a cut's record
  double depth = 0.5e-3, feed_per_tooth = 0.06e-3;  ///< [m]
  double displacement_noise = 5e-8;                 ///< [m] RMS
  CuttingFrfOptions options;

  /// The slots of a group, as a campaign's tests; entry at 0.02 s.
  std::vector<CampaignTest> tests(double speed) const;
  /// Simulated records, with the tool at the speed of each cut.
  Record record(const CampaignTest& test, std::uint64_t seed) const;
  /// FRFs of x and y of every group, tool displacement against the force sensor's force.
  std::array<std::vector<SpeedFrf>, 2> identify(std::uint64_t seed) const;
  /// Writes a campaign folder with all cuts of all groups.
  void write(const std::string& folder, std::uint64_t seed) const;
};

/// The tool of the studies: 1200 and 1100 Hz, 12 um of runout; at 18,000 rpm 12 % less stiffness and a
/// quarter more damping.
TurningToolCase turningToolCase();

}  // namespace smartmill::kalman
