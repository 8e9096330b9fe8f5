#pragma once

#include <complex>
#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/modal/modal_poles.h"
#include "smartmill_core/modal/modal_search_options.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {

struct ModalEstimateOptions {
  double low = 0.0, high = 0.0;  ///< [Hz] band; high 0: to the last line
  int largest_order = 60;        ///< of the stabilization diagram over the whole band
  int max_modes = 100;
  bool real_modes = false;  ///< proportional damping: gains without phase
  /// Called with the completed share, 0..1. @return false to stop with the modes found so far
  std::function<bool(double)> progress = {};
  ModalSearchOptions search = {};
};

/// One mode in all FRFs: (gain + i phase_part f / f_n) f_n^2 / (f_n^2 - f^2 + 2 i zeta f_n f). With
/// proportional damping the phase part is 0.
struct EstimatedMode {
  double frequency = 0.0, damping_ratio = 0.0;          ///< [Hz], [1]
  double frequency_std = 0.0, damping_ratio_std = 0.0;  ///< finite
  std::vector<double> gain, gain_std;                   ///< [unit of the FRF] per FRF
  std::vector<double> phase_part, phase_part_std;       ///< [unit of the FRF] per FRF
  double evidence = 0.0;  ///< Wald statistic over its largest value by chance: significant from 2.5
  std::string doubt;      ///< why the mode is doubtful; empty: it is proven

  std::complex<double> response(std::size_t frf, double f) const;  ///< [unit] at f [Hz]
};

/// Residual terms of modes outside the band: upper - lower / (2 pi f)^2.
struct ResidualTerms {
  std::complex<double> upper;  ///< [unit] of modes above, constant
  std::complex<double> lower;  ///< [unit/s2] of modes below, as a mass line

  std::complex<double> response(double f) const;  ///< [unit] at f [Hz]
};

struct ModalEstimate {
  std::vector<EstimatedMode> modes;           ///< significant, lowest frequency first
  std::vector<EstimatedMode> doubts;          ///< candidates that are not significant
  std::vector<ResidualTerms> residual_terms;  ///< per FRF, in addition to modes and doubts
  std::vector<Pole> diagram;                  ///< stabilization diagram of the whole band
  /// Phase rises through resonances (e^{-i w t}): the record was conjugated before the fit.
  bool conjugated = false;
  bool cancelled = false;
};

/// [unit] Fitted FRF of modes, doubts and residual terms at f [Hz], in the record's sign convention of phase.
std::complex<double> fittedResponse(const ModalEstimate& estimate, std::size_t frf, double f);

/// [unit] Noise of each line, E|error|^2 = noise^2, from the deviation from a parabola through its
/// neighbours: the median over an interval, which a peak does not affect.
std::vector<double> lineNoise(const std::vector<std::complex<double>>& value);

/// Whether the phase rises through the resonances: sign convention e^{-i w t}.
bool hasReversedPhase(const std::vector<FrequencyResponse>& frfs);

/// Modes of FRFs on common lines, with common poles. Start values come from the poly-reference least-squares
/// complex frequency method over the band and its segments, selected by stability. Each candidate is then
/// fitted with its neighbours (variable projection over Ceres) and stays while it is significant. Lines are
/// weighted by their standard deviation (by the observed noise where none is given), or by the misfit where
/// that is larger.
/// @throws Error on unequal lines, too few of them, or values that are not finite.
ModalEstimate estimateModes(const std::vector<FrequencyResponse>& frfs, const ModalEstimateOptions& options);

}  // namespace smartmill
