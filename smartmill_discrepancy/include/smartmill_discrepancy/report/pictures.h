#pragma once

#include <string>
#include <vector>

#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// Writes FOLDER/gaps.png, revolution.png, spectra.png, ladder.png, remains.png with gnuplot; returns the
/// files' names. @throws Error.
std::vector<std::string> drawPictures(const Explanation& explanation, const std::string& folder);

}  // namespace smartmill::discrepancy
