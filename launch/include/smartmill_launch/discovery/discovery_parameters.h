#pragma once

#include <string>
#include <vector>

#include "smartmill_launch/discovery/believed_limits.h"
#include "smartmill_launch/session/cut_planner.h"

namespace smartmill::discovery {

/// Parameters of discover_node.
struct DiscoveryParameters {
  std::string model;
  std::string record_folder;
  std::string folder;
  std::string prior;

  std::vector<double> watch_speeds{418.9, 439.8, 397.9, 680.7, 471.2, 261.8};
  std::vector<double> watch_feeds{5.0e-5, 1.5e-4, 1.0e-4, 1.1e-4, 9.0e-5, 1.2e-4};
  std::vector<double> watch_depths{1.0e-3, 1.2e-3, 1.3e-3, 1.4e-3, 2.0e-3, 1.5e-3};
  std::vector<double> watch_air{523.6};
  double slot_time = 0.9, least_slot_time = 0.8;
  double air_time = 1.0;
  double stable_share = 0.5;

  int threads = 2;
  double ready_timeout = 30.0;
  double program_timeout = 60.0;
  double judged_timeout = 10.0;
  double quiet_time = 1.0;
  double explain_budget = 300.0;

  session::PathParameters paths;

  void declare(ParameterTable& table);
  /// @throws Error naming key and value.
  void validate() const;

  /// The initial cuts, in order, no deeper than the limits. @param prefix of their names @param lane of the
  /// first slot
  /// @throws Error if a cut does not fit machine or stock.
  std::vector<session::PlannedCut> initialCuts(const session::CutPlanner& planner, const std::string& prefix,
                                               std::size_t lane, const BelievedLimits& limits = {}) const;
  /// A slot with name, lane and times; cutting conditions not set.
  session::SlotRequest slotRequest(const std::string& name, std::size_t lane) const;
};

}  // namespace smartmill::discovery
