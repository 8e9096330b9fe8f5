#pragma once

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
};

/// The complete workflow: check labels, search for missing effects, localise the disagreement, validate
/// effects, write FOLDER/model.yaml and measure the gap with that file. When cancelled, it ends with the
/// effects found so far.
/// @throws Error if campaign or model cannot be used.
Explanation explain(const Dataset& data, const ExplainOptions& options, const std::string& folder);

}  // namespace smartmill::discrepancy
