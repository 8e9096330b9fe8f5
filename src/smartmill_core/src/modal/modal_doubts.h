#pragma once

#include <vector>

#include "smartmill_core/modal/modal_estimate.h"

namespace smartmill {

/// Moves significant modes that are not plausible at their place to the doubts, and states the reason of each
/// doubt.
///
/// Without coherence on its lines a mode is doubtful, because the force had no power there. So is the flank
/// of a resonance that drifts from hit to hit: its average is the peak of no mode, and is fitted by several
/// modes side by side. Residues of lightly damped neighbours are real at a driving point and have phases of 0
/// or 180 deg to each other elsewhere, those of flanks have not; the coherence there is low, because the hits
/// disagree. The smaller of two such neighbours is a flank, and both are where they are of a size.
/// @param bands FRFs of the estimate
void judgeModes(const std::vector<FrequencyResponse>& bands, const ModalSearchOptions& options,
                ModalEstimate& estimate);

}  // namespace smartmill
