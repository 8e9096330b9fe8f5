#pragma once

#include <string>
#include <vector>

#include "smartmill_core/modal/modal_estimate.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {

/// Columns frequency_hz,real,imag,coherence,std; what is not known stays empty. @throws Error.
void writeFrfCsv(const FrequencyResponse& frf, const std::string& file);

/// Lists `modes` and `doubts`, of each frequency_hz, damping_ratio, and stiffness_n_per_um (receptance) or
/// gain (force over force) of the first FRF, each with _std, evidence, and phase_deg of the gain, 0 of a real
/// mode. The gain is the residue's size with the sign of its real part. Of several FRFs also `gains`, one
/// each.
/// @param names of the FRFs @throws Error.
void writeModesYaml(const ModalEstimate& estimate, const std::string& unit,
                    const std::vector<std::string>& names, const std::string& file);

/// Real modes as the estimator would state them; their evidence is not known (NaN).
ModalEstimate estimateOf(const ModalModel& model);

/// Static gain of a mode in one FRF with its standard deviation: size of the residue, sign of its real part.
struct Gain {
  double value = 0.0, std = 0.0, phase = 0.0;  ///< [unit], [unit], [rad]
};
Gain gainOf(const EstimatedMode& mode, std::size_t frf);

}  // namespace smartmill
