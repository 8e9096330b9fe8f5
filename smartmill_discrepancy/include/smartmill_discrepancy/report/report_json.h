#pragma once

#include <string>

#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// Writes FOLDER/report.json (smartmill-report/2). @throws Error.
void writeReport(const Explanation& explanation, const std::string& folder);

}  // namespace smartmill::discrepancy
