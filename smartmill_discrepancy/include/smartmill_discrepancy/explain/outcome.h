#pragma once

#include <map>
#include <string>
#include <vector>

#include "smartmill_discrepancy/results/explanation.h"
#include "smartmill_discrepancy/search/workbench.h"

namespace smartmill::discrepancy {

/// What a model leaves of the records, over noise, and its RMS in all that is judged.
struct Remains {
  std::vector<double> fit, heldout;
  GapPair gap;
  std::map<std::string, double> chattering;  ///< prediction errors, as in ChatteringCut, by tests
};
Remains remainsOf(const Workbench& bench, const MachineModel& model);

/// Writes the improved model into FOLDER/model.yaml, reads it and measures what it leaves.
/// @param result receives model, after, gaps and curves
void writeOutcome(const Workbench& bench, const Remains& before, const MachineModel& improved,
                  const std::string& folder, Explanation* result);

/// Shares of the variance explained and repeated, channel by channel over all cuts.
void addChannelShares(const Workbench& bench, const Remains& before, const Remains& after,
                      Explanation* explanation);

/// Curves of the test and channels in which nominal model and records differ most.
void addCurves(const TwinRunner& runner, const std::vector<double>& before, const std::vector<double>& after,
               Explanation* explanation);

}  // namespace smartmill::discrepancy
