#pragma once

#include <string>
#include <vector>

#include "smartmill_core/modal/modal_estimate.h"
#include "smartmill_hammer/analysis/tap_records.h"

namespace smartmill::hammer {

/// Magnitude, phase, coherence where known, and the fit. All @throw Error when gnuplot fails.
void drawFrf(const FrequencyResponse& frf, const ModalEstimate& estimate, std::size_t index,
             const std::string& title, const std::string& png);

/// Stabilization diagram: stable and other poles over the order of the model, the magnitude of all FRFs,
/// modes and doubtful modes as lines.
void drawStabilization(const std::vector<NamedFrf>& frfs, const ModalEstimate& estimate,
                       const std::string& png);

/// Force and response of every hit, with its verdict.
void drawHits(const std::vector<TapRecord>& taps, const std::vector<TapVerdict>& verdicts,
              const std::string& png);

}  // namespace smartmill::hammer
