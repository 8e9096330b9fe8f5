#pragma once

#include <map>
#include <string>
#include <vector>

#include "smartmill_discrepancy/results/explanation.h"
#include "smartmill_discrepancy/search/workbench.h"

namespace smartmill::discrepancy {

/// Whitened residual of a model and its gap.
struct ModelResidual {
  std::vector<double> fit, heldout;
  GapPair gap;
  std::map<std::string, double> chattering;  ///< prediction errors by test, as in ChatteringCut
};
ModelResidual residualOf(const Workbench& bench, const MachineModel& model);

/// Gap of a residual over the noise; 0: there are no tests.
double gapOf(const TwinRunner& runner, const std::vector<double>& residual);

/// Writes the improved model to FOLDER/model.yaml, reads it back and measures its residual.
/// @param result receives model, after, gaps and curves
void writeOutcome(const Workbench& bench, const ModelResidual& before, const MachineModel& improved,
                  const std::string& folder, Explanation* result);

/// Explained and synchronous shares of the variance, channel by channel over all cuts.
void addChannelShares(const Workbench& bench, const ModelResidual& before, const ModelResidual& after,
                      Explanation* explanation);

/// Curves of the test and channels with the largest residual of the nominal model.
void addCurves(const TwinRunner& runner, const std::vector<double>& before, const std::vector<double>& after,
               Explanation* explanation);

}  // namespace smartmill::discrepancy
