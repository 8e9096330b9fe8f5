#pragma once

#include <string>
#include <vector>

#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// Draws FOLDER/gaps.png, revolution.png, spectra.png, candidates.png and residual.png with gnuplot.
/// @return names of the files @throws Error.
std::vector<std::string> drawPictures(const Explanation& explanation, const std::string& folder);

}  // namespace smartmill::discrepancy
