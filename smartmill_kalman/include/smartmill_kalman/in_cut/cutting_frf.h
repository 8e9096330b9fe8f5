#pragma once

#include <complex>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill::kalman {

/// Steady segment of a cut, one axis.
struct CutSegment {
  std::string name;               ///< for messages
  double sample_rate = 0.0;       ///< [Hz]
  double speed = 0.0;             ///< [rad/s] of the spindle
  std::vector<double> angle;      ///< [rad] of the spindle, wrapped or not; empty: constant speed
  std::vector<double> force;      ///< [N] excitation, measured through `chain`
  std::vector<double> response;   ///< [unit x N]
  ModalModel chain;               ///< [1] force sensor; its standard deviations count where they are known
  double relative_force_std = 0;  ///< [1] of a force that is predicted by a model
  int every = 1;                  ///< [1] lines: multiples of this order of the spindle

  CutSegment() { chain.direct = 1.0; }
};

/// FRF at one harmonic of the spindle.
struct FrfLine {
  double frequency = 0.0;      ///< [Hz]
  double speed = 0.0;          ///< [rad/s] of the spindle
  std::complex<double> value;  ///< [unit]
  double std_dev = 0.0;        ///< [unit] root of E|error|^2
  double force = 0.0;          ///< [N] amplitude
};

struct CuttingFrfOptions {
  double low = 300.0, high = 5000.0;  ///< [Hz] band of the lines and of the fit
  double part = 0.2;                  ///< [s] length of the parts of a record, each with its own speed
  double least_signal = 5.0;          ///< [1] amplitude of a force's line over its noise
  double speed_width = 0.2;           ///< [1] cuts within this range of speed are one FRF
  int least_lines = 12;               ///< [1] of a fit
  int max_modes = 4;
  int noise_orders = 8;     ///< half orders around a harmonic that estimate its noise; more mix other noise
  double same_line = 5e-4;  ///< [1] of frequency: lines that are averaged, far within a mode's width
  double same_mode = 0.1;   ///< [1] of frequency: a mode at neighbouring speeds
  double least_gain_deviations = 3.0;  ///< [1] gain over its standard deviation, for a significant mode
  double same_speed = 3e-3;            ///< [1] of speed: lines of one cut, whose speed varies by less
  std::size_t least_cuts = 5;          ///< for a jackknife over the cuts
  int passes = 4;                 ///< of the iteration between slopes and fits, after which it is settled
  bool unit_static_gain = false;  ///< of a force sensor
  /// @throws Error naming key and value.
  void validate() const;
};

/// FRF lines of one cut: in each part, response over force at every harmonic of the spindle, with a four-term
/// Blackman-Harris window that separates the harmonics from the spectrum between them. Standard deviations
/// come from the non-synchronous part: the spectra of force and response midway between the harmonics. A part
/// needs eleven revolutions. Lines whose force does not exceed that noise are omitted.
/// @throws Error on unequal lengths, NaN, or a speed that is not above zero.
std::vector<FrfLine> frfLines(const CutSegment& cut, const CuttingFrfOptions& options);

/// An FRF at one speed of the spindle.
struct SpeedFrf {
  double speed = 0.0;                  ///< [rad/s] mean of its lines
  double lowest = 0.0, highest = 0.0;  ///< [rad/s]
  FrequencyResponse frf;               ///< uneven lines, with std_dev
  std::optional<ModalFit> fit;
  std::string reason;  ///< why there is no fit
};

/// FRFs of many cuts, grouped by speed; lines at one frequency are averaged. Modes by fitModes(). A group
/// with too few lines, or without a significant mode, has no fit but a reason. A mode that depends on the
/// speed also shifts within a group: its slope comes from the neighbouring groups, each line is corrected to
/// the group's mean speed, and the uncertainty of the slope widens the standard deviations. A single group is
/// treated as one speed.
/// @param unit of the lines, m/N or 1
std::vector<SpeedFrf> cuttingFrfs(std::vector<FrfLine> lines, const std::string& unit,
                                  const CuttingFrfOptions& options);

}  // namespace smartmill::kalman
