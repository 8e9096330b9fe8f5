#pragma once

#include <string>
#include <vector>

#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// Writes FOLDER/report.html with embedded pictures. @throws Error.
void writeHtml(const Explanation& explanation, const std::string& campaign,
               const std::vector<std::string>& pictures, const std::string& folder);

}  // namespace smartmill::discrepancy
