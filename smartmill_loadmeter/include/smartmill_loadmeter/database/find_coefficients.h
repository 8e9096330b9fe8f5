#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/database/knowledge.h"
#include "smartmill_loadmeter/identification/cut_choice.h"
#include "smartmill_loadmeter/identification/test_information.h"

namespace smartmill::loadmeter {

/// Answer of the service loadmeter/find_coefficients.
struct FoundCoefficients {
  std::optional<CoefficientKnowledge> known;  ///< of the pair
  /// Without records of the pair: from other tools and materials, by the methods of recommendCut().
  std::optional<CoefficientSet> predicted;
  std::vector<std::size_t> needed;   ///< indices of the planned tests; all without knowledge of the pair
  std::optional<SuggestedCut> next;  ///< cut that would reduce the uncertainty most
  CuttingCondition next_condition;   ///< the same with tool and material
  std::string message;               ///< one line: origin of the coefficients, or the known pairs
};

/// Knowledge of a tool in a material; the planned tests that it makes unnecessary; the next test. The next
/// test has speed and feed within a factor of two of those covered, their depth, so that it is as stable as
/// they were, and stays within speed, torque and power of the model's spindle.
/// @param tests planned air cuts and cuts; may be empty
/// @throws Error when the database cannot be read.
FoundCoefficients findCoefficients(const CoefficientDatabase& database, const std::string& tool,
                                   const std::string& material, const std::vector<CuttingCondition>& tests,
                                   const MachineModel& model);

/// Candidate cuts of a session, of which those to make are chosen.
struct CutChoiceRequest {
  std::vector<CuttingCondition> made;  ///< air cuts and cuts
  std::vector<CandidateCut> candidates;
  double ktc_std = 0.0, kte_std = 0.0;  ///< [N/m2], [N/m] to reach
  double stock = 0.0;                   ///< [m] width available
  bool without_stored = false;          ///< without the coefficients of the database
};

/// Chooses cuts (chooseCuts()) that together with the tests that are made and, if the pair is known, with the
/// database reach the standard deviations, within torque and power of the model's spindle. Two feeds suffice
/// with earlier knowledge, as for the identification.
/// @param air_cuts measured in the session, whose readings show the noise of the load meter. @param settling
/// [s] of a steady part without readings
/// @throws Error if the model has no spindle or the air cuts have fewer than two speeds.
CutChoice chooseCuts(const FoundCoefficients& found, const CutChoiceRequest& request,
                     const std::vector<LoadTest>& air_cuts, double settling, const MachineModel& model);

}  // namespace smartmill::loadmeter
