#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "plant/machine.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::plant {

/// One case of a bench: what is hidden, in a machine with a rigid or a vibrating tool.
struct Case {
  std::string kind;                ///< single, pair, triple, none, outside
  std::vector<std::string> names;  ///< effects of the catalogue; of an outside cause its kind
  bool vibrating = false;
  std::uint64_t seed = 0;  ///< everything else follows from it
};

/// How many cases of each kind.
struct Counts {
  int singles = 0;  ///< of each effect
  int pairs = 0, triples = 0, none = 0, outside = 0;
};

/// The cases of a bench, rigid and vibrating in turn. The same arguments give the same cases.
/// @param names effects to draw from
std::vector<Case> drawCases(const Counts& counts, const std::vector<std::string>& names, std::uint64_t seed);

/// A machine, what is believed of it and how it is tested.
struct Drawn {
  Plant plant;
  MachineModel nominal;  ///< with values off by their stated uncertainty, without what is hidden
  Campaign campaign;     ///< tests; files are not written
  bool angle = true;     ///< the spindle angle is recorded
};

Drawn draw(const Case& hidden);

/// Runs every test. @param second another draw of what differs from run to run (noise, unsteadiness, not the
/// spindle's phase) @throws Error.
std::vector<Record> runCampaign(const Drawn& drawn, const Case& hidden, bool second = false);

/// Writes a campaign folder: model.yaml, campaign.yaml, records (one a test). @throws Error.
void writeCampaignOf(const Drawn& drawn, const std::vector<Record>& records, const std::string& folder);

/// What is hidden, as YAML (for the scorer). @throws Error.
void writeTruth(const Drawn& drawn, const std::string& file);

}  // namespace smartmill::plant
