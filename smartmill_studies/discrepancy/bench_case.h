#pragma once

#include <functional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "plant/draw.h"

namespace smartmill::discrepancy {

/// Runs one case of the blind bench: the plant hides causes, explain gets only the campaign, and its report
/// is compared with the hidden truth.
/// @param folder for the campaign and explain's report @param receives progress lines; may be empty
/// @return one line of the bench: case, kind, hidden, vibrating, verdict (or why the campaign was refused),
/// named (name, confidence, right), empirical (forms found without a name), right,
/// false_effect, largest_z (distance of a parameter from the truth [standard deviations]), parameters, inside
/// (number of them within 1.96), gap_before, gap_after, heldout_before (with named effects only),
/// heldout_after, floor, heldout_floor (fitted and held-out tests: gap between two runs of the plant over
/// root 2, without taps), seconds (of explain)
nlohmann::json runBenchCase(const plant::Case& hidden, int number, const std::string& folder,
                            const std::function<void(const std::string&)>& progress);

}  // namespace smartmill::discrepancy
