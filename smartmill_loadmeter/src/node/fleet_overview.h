#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/fleet.h"
#include "smartmill_loadmeter/database/fleet_model.h"

namespace smartmill::loadmeter {

/// What a fleet knows of one tool in one material.
struct FleetPair {
  std::string tool, material;
  std::size_t records = 0, own = 0;  ///< of all machines, of the one that asks
  double ktc = CoefficientRecord::UNKNOWN,
         ktc_std = CoefficientRecord::UNKNOWN;  ///< [N/m2] of its next cut; NaN: nothing is known
};

/// One machine as its fleet sees it.
struct FleetMachine {
  FleetMember member;              ///< login empty: only its name stands in records
  bool here = false;               ///< the one that asks
  std::vector<std::size_t> knows;  ///< records of each pair
  double effect = CoefficientRecord::UNKNOWN, effect_std = CoefficientRecord::UNKNOWN;  ///< [1] of ln Ktc
  double odd = CoefficientRecord::UNKNOWN;                                              ///< [1] probability
  std::string meaning;  ///< what an odd one points to; empty: it is none
};

struct FleetOverview {
  FleetDeviations deviations;          ///< of ln Ktc; NaN: not known
  std::vector<FleetPair> pairs;        ///< most records first
  std::vector<FleetMachine> machines;  ///< by name
};

/// Login in an address, empty: none is told.
std::string loginOf(const std::string& url);

/// Who knows what, and who is odd by the fleet's model of Ktc. A record belongs to the member whose name or
/// login it bears. @param login of the machine that asks
FleetOverview fleetOverview(const std::vector<FleetMember>& members,
                            const std::vector<CoefficientRecord>& records, const std::string& login);

/// The same records, but members as they are now. @return false when one is new: a fresh overview is due
bool renew(const std::vector<FleetMember>& members, FleetOverview& overview);

}  // namespace smartmill::loadmeter
