#pragma once

#include <complex>
#include <functional>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/modal/modal_poles.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {

struct ModalEstimateOptions {
  double low = 0.0, high = 0.0;  ///< [Hz] band; high 0: to the last line
  int largest_order = 60;        ///< of the stabilization diagram over the whole band
  int max_modes = 100;
  bool real_modes = false;  ///< proportional damping: gains without phase
  /// Called with the share done, 0..1. @return false to end with what is found so far
  std::function<bool(double)> progress = {};
};

/// One mode in all FRFs: (gain + i phase_part f / f_n) f_n^2 / (f_n^2 - f^2 + 2 i zeta f_n f). A phase part
/// of 0 is a mode of proportional damping.
struct EstimatedMode {
  double frequency = 0.0, damping_ratio = 0.0;          ///< [Hz], [1]
  double frequency_std = 0.0, damping_ratio_std = 0.0;  ///< finite
  std::vector<double> gain, gain_std;                   ///< [unit of the FRF] per FRF
  std::vector<double> phase_part, phase_part_std;       ///< [unit of the FRF] per FRF
  double evidence = 0.0;  ///< Wald's statistic over what chance gives: proven from 2.5 on

  std::complex<double> response(std::size_t frf, double f) const;  ///< [unit] at f [Hz]
};

/// What modes outside the lines leave inside: upper - lower / (2 pi f)^2.
struct ResidualTerms {
  std::complex<double> upper;  ///< [unit] of modes above, as an even share
  std::complex<double> lower;  ///< [unit/s2] of modes below, as a mass line

  std::complex<double> response(double f) const;  ///< [unit] at f [Hz]
};

struct ModalEstimate {
  std::vector<EstimatedMode> modes;   ///< proven, lowest frequency first
  std::vector<EstimatedMode> doubts;  ///< seen, not proven
  std::vector<ResidualTerms> flanks;  ///< per FRF, beside modes and doubts
  std::vector<Pole> diagram;          ///< of the whole band: the stabilization diagram
  /// Phase rises through resonances: the record's e^{-i w t} was turned before the fit.
  bool conjugated = false;
  bool cancelled = false;
};

/// What modes, doubts and flanks make of an FRF at f [Hz], in the record's own sign of phase. [unit]
std::complex<double> fittedResponse(const ModalEstimate& estimate, std::size_t frf, double f);

/// Noise of each line, E|error|^2 = noise^2: from what its neighbours leave of a parabola, the median over a
/// stretch, which a peak does not move. [unit]
std::vector<double> lineNoise(const std::vector<std::complex<double>>& value);

/// True when phase rises through the resonances: sign convention e^{-i w t}.
bool turnsBackwards(const std::vector<FrequencyResponse>& frfs);

/// Modes of FRFs on common lines, with common poles: start values by the poly-reference least-squares complex
/// frequency method over the band and over its parts, picked by their stability; each candidate is then
/// fitted with its neighbours (variable projection over Ceres) and stays while the misfit proves it. Lines
/// are weighted by their standard deviation (by the noise seen where none is given), and by the misfit where
/// that is larger.
/// @throws Error on unequal lines, too few of them, or values that are not finite.
ModalEstimate estimateModes(const std::vector<FrequencyResponse>& frfs, const ModalEstimateOptions& options);

}  // namespace smartmill
