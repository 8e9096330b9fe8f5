#pragma once

#include <functional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "plant/draw.h"

namespace smartmill::discrepancy {

/// Runs one case of the blind bench: the plant hides its causes, explain looks for them with nothing but the
/// campaign, then the seal is opened.
/// @param folder for the campaign and explain's report @param progress lines, may be empty
/// @return one line of the bench: case, kind, hidden, vibrating, verdict (or why the campaign was refused),
/// named and resembling (name, confidence, right), empirical (forms found without a name), right,
/// false_effect, largest_z (distance of a parameter from the truth [standard deviations]), parameters, inside
/// (of them within 1.96), gap_before, gap_after, heldout_before (with what has a name only), heldout_after,
/// floor, heldout_floor (of the tests to be fitted and of those held out: gap between two runs of the plant
/// over root 2, as every gap in noise RMS, without taps), seconds (of explain)
nlohmann::json runBenchCase(const plant::Case& hidden, int number, const std::string& folder,
                            const std::function<void(const std::string&)>& progress);

}  // namespace smartmill::discrepancy
