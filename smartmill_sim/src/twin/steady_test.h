#pragma once

#include <array>
#include <optional>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/twin/cutting_machine.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::sim {

/// Input of a test with constant (or periodically varied) spindle speed and, in a cut, constant feed.
class SteadyTest {
 public:
  /// @param phase [rad] angle of tooth 1 at the time `begin` [s] of the first sample
  SteadyTest(const MachineModel& model, const CampaignTest& test, double phase, double begin,
             const SimulationOptions& options, CuttingMachine& machine);

  /// Updates the input for a time [s] within the record; the tool engages at its time.
  void next(double t, CuttingMachine::Input& input);
  /// Simulates the lead-in before the record of a running cut.
  void leadIn();

 private:
  void inputAt(double t, CuttingMachine::Input& input) const;
  bool cut() const { return test_.kind == TestKind::cut; }
  void engage(const ToolMotion& now, double depth);

  const CampaignTest& test_;
  double phase_, begin_;
  int substeps_;
  LeadIn lead_in_;
  std::optional<SpeedVariation> variation_;
  double rise_;  // [samples]
  CuttingMachine& machine_;
  double start_;                        // [s] begin of the cut
  std::array<double, 2> feed_{{0, 0}};  // [m/s] x, y
  bool engaged_ = false;
};

}  // namespace smartmill::sim
