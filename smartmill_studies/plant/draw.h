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

/// One case of a bench: the hidden effects, in a machine with a rigid or a vibrating tool.
struct Case {
  std::string kind;                ///< single, pair, triple, none, outside
  std::vector<std::string> names;  ///< effects of the catalogue, or the kind of an outside cause
  bool vibrating = false;
  std::uint64_t seed = 0;       ///< determines everything else
  double nominal_errors = 1.0;  ///< [1] standard deviation of the nominal values over the stated one
};

/// How many cases of each kind.
struct Counts {
  int singles = 0;  ///< of each effect
  int pairs = 0, triples = 0, none = 0, outside = 0;
};

/// The cases of a bench, rigid and vibrating in turn. The same arguments give the same cases.
/// @param names effects to draw from @param outside kinds of outside causes, drawn in turn
std::vector<Case> drawCases(const Counts& counts, const std::vector<std::string>& names, std::uint64_t seed,
                            const std::vector<std::string>& outside = outsideKinds());

/// A machine, its nominal model and its tests.
struct Drawn {
  Plant plant;
  MachineModel nominal;  ///< with errors drawn from the stated uncertainties, without the hidden effects
  Campaign campaign;     ///< tests; files are not written
  bool angle = true;     ///< the spindle angle is recorded
};

Drawn draw(const Case& hidden);

/// Runs every test. @param second new draw of the random parts (noise, coefficient scatter, but not the
/// spindle's phase) @throws Error.
std::vector<Record> runCampaign(const Drawn& drawn, const Case& hidden, bool second = false);

/// Writes a campaign folder: model.yaml, campaign.yaml, records (one a test). @throws Error.
void writeCampaignOf(const Drawn& drawn, const std::vector<Record>& records, const std::string& folder);

/// The hidden effects as YAML (for the scorer). @throws Error.
void writeTruth(const Drawn& drawn, const std::string& file);

}  // namespace smartmill::plant
