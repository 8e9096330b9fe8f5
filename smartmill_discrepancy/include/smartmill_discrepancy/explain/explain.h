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

/// The whole workflow: check the labels, search which effects are missing, see where the model differs,
/// challenge what was found, judge it, write FOLDER/model.yaml and measure the gap after from that file.
/// Cancelled, it ends with what was found until then.
/// @throws Error on a campaign or model that cannot be worked with.
Explanation explain(const Dataset& data, const ExplainOptions& options, const std::string& folder);

}  // namespace smartmill::discrepancy
