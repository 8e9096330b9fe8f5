#pragma once

#include <complex>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill::kalman {

/// A stretch of a cut in its steady state, one axis.
struct CutSegment {
  std::string name;              ///< for messages
  double sample_rate = 0.0;      ///< [Hz]
  double speed = 0.0;            ///< [rad/s] of the spindle
  std::vector<double> angle;     ///< [rad] of the spindle, with or without its jumps; empty: the speed holds
  std::vector<double> force;     ///< [N] what drives the structure, as `chain` shows it
  std::vector<double> response;  ///< [unit x N]
  ModalModel chain;  ///< [1] of the sensor that shows the force; its deviations count where they are told
  double relative_force_std = 0;  ///< [1] of a force that a model tells
  int every = 1;                  ///< [1] lines: multiples of this order of the spindle

  CutSegment() { chain.direct = 1.0; }
};

/// What a structure answers at one harmonic of the spindle.
struct FrfLine {
  double frequency = 0.0;      ///< [Hz]
  double speed = 0.0;          ///< [rad/s] of the spindle
  std::complex<double> value;  ///< [unit]
  double std_dev = 0.0;        ///< [unit] root of E|error|^2
  double force = 0.0;          ///< [N] amplitude
};

struct CuttingFrfOptions {
  double low = 300.0, high = 5000.0;  ///< [Hz] lines that are taken, and band of the fit
  double part = 0.2;          ///< [s] a record is cut into parts about so long, each with its own speed
  double least_signal = 5.0;  ///< [1] amplitude of a force's line over its noise
  double speed_width = 0.2;   ///< [1] cuts within this range of speed are one FRF
  int least_lines = 12;       ///< [1] below, nothing is told
  int max_modes = 4;
  bool unit_static_gain = false;  ///< of a force sensor
  /// @throws Error naming key and value.
  void validate() const;
};

/// Lines of one cut: in each part, response over force at every harmonic of the spindle, seen through a
/// four-term Blackman-Harris window that keeps lines and what is between them apart. Standard deviations
/// come from what does not repeat with the revolution: the spectra midway between the harmonics, of force and
/// response. A part needs eleven revolutions. Lines whose force does not stand out of that are left out.
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

/// Lines of many cuts, parted by speed; lines at one frequency become one. Modes by fitModes(). Where lines
/// are too few, or prove no mode, there is no fit, and the reason is told. A mode that moves with the speed
/// moves within a group as well: from the groups beside it comes how, each line is taken to what it would be
/// at the group's mean speed, and what is not known of that widens the deviations. One group alone is taken
/// for one tool.
/// @param unit of the lines, m/N or 1
std::vector<SpeedFrf> cuttingFrfs(std::vector<FrfLine> lines, const std::string& unit,
                                  const CuttingFrfOptions& options);

}  // namespace smartmill::kalman
