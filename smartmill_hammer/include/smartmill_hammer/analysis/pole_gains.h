#pragma once

#include <complex>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_hammer/analysis/tip_correction.h"

namespace smartmill::hammer {

/// The gains of modes of known frequency and damping in an FRF of the same structure struck or measured at
/// other points, together with the residual terms of modes outside the band (a constant, and one proportional
/// to the square of the frequency). Least squares weighted by the lines' standard deviations; the misfit
/// scales those of the gains. @param low, high [Hz] band
/// @throws Error when the band contains too few lines or the lines do not distinguish the modes
ModalModel gainsAtPoles(const FrequencyResponse& frf, const ModalModel& poles, double low, double high);

/// The shifts of fitted modes by a change of their FRF, to first order: frequencies, damping ratios and gains
/// of the result are differences. @throws as gainsAtPoles()
ModalModel modeShifts(const FrequencyResponse& frf, const std::vector<std::complex<double>>& change,
                      const ModalModel& model, double low, double high);

/// The cross FRF [m/N] at the tip from one measured above it: the gain of each mode changes by the same
/// factor as in the direct FRF.
FrequencyResponse crossTipResponse(const FrequencyResponse& cross, const TipCorrection& correction,
                                   double low, double high);

}  // namespace smartmill::hammer
