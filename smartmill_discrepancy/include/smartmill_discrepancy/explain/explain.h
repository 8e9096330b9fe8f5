#pragma once

#include <functional>
#include <limits>
#include <string>

#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/gap/structure.h"
#include "smartmill_discrepancy/results/explanation.h"
#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

struct ExplainOptions {
  WorkbenchOptions bench;
  SearchOptions search;
  StructureOptions structure;
  double budget = std::numeric_limits<double>::infinity();  ///< [s] of the whole workflow
  std::function<double()> elapsed;                          ///< [s] since its begin; required by a budget
};

/// The complete workflow: check labels, search for missing effects, localise the disagreement, validate
/// effects, write FOLDER/model.yaml and measure the gap with that file. When cancelled, or when its budget is
/// spent, it ends with the effects found so far, judged as usual, and the effects that were not tried.
/// @throws Error if campaign or model cannot be used.
Explanation explain(const Dataset& data, const ExplainOptions& options, const std::string& folder);

}  // namespace smartmill::discrepancy
