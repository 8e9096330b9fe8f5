#pragma once

#include <complex>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_hammer/analysis/tip_correction.h"

namespace smartmill {
namespace hammer {

/// The gains that modes of known frequency and damping have in an FRF of the same structure struck or read
/// elsewhere, beside what modes outside the band leave (an even share, and one that grows with the square of
/// the frequency); least squares weighted by the lines' deviations, scaled up by the misfit.
/// @param low, high [Hz] band @throws Error when it holds too few lines or the modes are not told apart
ModalModel gainsAtPoles(const FrequencyResponse& frf, const ModalModel& poles, double low, double high);

/// By how much a change of an FRF moves its fitted modes: frequencies, damping and gains of the answer are
/// the shifts, to first order. @throws as gainsAtPoles()
ModalModel shiftOf(const FrequencyResponse& frf, const std::vector<std::complex<double>>& change,
                   const ModalModel& model, double low, double high);

/// A cross FRF [m/N], struck above the tip and read across, turned into the tip's: each mode of the
/// correction gains what it gains in its own direction.
FrequencyResponse crossTipResponse(const FrequencyResponse& cross, const TipCorrection& correction,
                                   double low, double high);

}  // namespace hammer
}  // namespace smartmill
