#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/fleet.h"
#include "smartmill_loadmeter/database/fleet_model.h"

namespace smartmill::loadmeter {

/// Records of one tool in one material.
struct FleetPair {
  std::string tool, material;
  std::size_t records = 0, own = 0;  ///< of all machines, of this machine
  double ktc = CoefficientRecord::UNKNOWN,
         ktc_std = CoefficientRecord::UNKNOWN;  ///< [N/m2] predicted for its next cut; NaN: unknown
};

/// Machine in its fleet.
struct FleetMachine {
  FleetMember member;                        ///< login empty: only named in records
  bool here = false;                         ///< this machine
  std::vector<std::size_t> records_by_pair;  ///< records of each pair
  double effect = CoefficientRecord::UNKNOWN, effect_std = CoefficientRecord::UNKNOWN;  ///< [1] of ln Ktc
  double outlier = CoefficientRecord::UNKNOWN;                                          ///< [1] probability
  std::string meaning;  ///< probable cause of an outlier; empty: not an outlier
};

struct FleetOverview {
  FleetDeviations deviations;          ///< of ln Ktc; NaN: unknown
  std::vector<FleetPair> pairs;        ///< most records first
  std::vector<FleetMachine> machines;  ///< by name
};

/// Login in an address; empty: none.
std::string loginOf(const std::string& url);

/// Records of each machine, and outliers by the fleet's model of Ktc. A record belongs to the member with its
/// machine name or login. @param login of this machine
FleetOverview fleetOverview(const std::vector<FleetMember>& members,
                            const std::vector<CoefficientRecord>& records, const std::string& login);

/// Updates the members for unchanged records. @return false when a member is new, so that a new overview is
/// needed
bool updateMembers(const std::vector<FleetMember>& members, FleetOverview& overview);

}  // namespace smartmill::loadmeter
