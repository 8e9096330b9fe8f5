#pragma once

#include <string>

#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// Writes FOLDER/report.html for an engineer at the machine: verdict, causes, what to do, next test,
/// difference, remainder, tests, data and search on two printed pages; plots and an appendix after them.
/// @param campaign folder or bag, as in the commands of the page @throws Error.
void writeHtml(const Explanation& explanation, const std::string& campaign, const std::string& folder);

}  // namespace smartmill::discrepancy
