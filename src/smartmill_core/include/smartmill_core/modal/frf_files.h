#pragma once

#include <string>
#include <vector>

#include "smartmill_core/modal/modal_estimate.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {

/// Columns frequency_hz,real,imag,coherence,std; unknown values are empty. @throws Error.
void writeFrfCsv(const FrequencyResponse& frf, const std::string& file);

/// Writes the lists `modes` and `doubts`. Each entry has frequency_hz, damping_ratio, and stiffness_n_per_um
/// (receptance) or gain (force over force) of the first FRF, each with _std, evidence, and phase_deg of the
/// gain (0 for a real mode). The gain is the magnitude of the residue with the sign of its real part. With
/// several FRFs also `gains`, one per FRF.
/// @param names of the FRFs @throws Error.
void writeModesYaml(const ModalEstimate& estimate, const std::string& unit,
                    const std::vector<std::string>& names, const std::string& file);

/// Real modes in the form of an estimate, with evidence NaN.
ModalEstimate estimateOf(const ModalModel& model);

/// Static gain of a mode in one FRF with its standard deviation: magnitude of the residue with the sign of
/// its real part.
struct Gain {
  double value = 0.0, std = 0.0, phase = 0.0;  ///< [unit], [unit], [rad]
};
Gain gainOf(const EstimatedMode& mode, std::size_t frf);

}  // namespace smartmill
