#pragma once

#include <random>
#include <string>
#include <vector>

#include "plant/beam.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_hammer/analysis/tip_correction.h"

namespace smartmill::studies {

/// A tool in a spindle of the benches' own plant (Euler beam on a rigid spindle with two springs; the
/// correction's beam shears and sits in springs), what is believed of it, and the station's offset.
struct OffsetCase {
  plant::ToolInSpindle truth;
  hammer::ToolBeam believed;
  double offset = 0.0;  ///< [m] hammer above sensor
};
OffsetCase drawOffsetCase(std::mt19937_64& random);

/// FRF of 20..5500 Hz, 10 Hz lines, struck and read at heights above the tip [m], with noise (a share of its
/// rms).
FrequencyResponse crossFrf(const plant::ToolInSpindle& tool, double struck, double read, double noise,
                           std::mt19937_64& random);

/// Ways to come from the measured cross FRF to the tip's.
enum class Way { none, thesis, one_height, two_heights };
constexpr int WAYS = 4;
std::string nameOf(Way way);

/// What a way says of one true mode below 5 kHz.
struct GainError {
  double frequency = 0.0;  ///< [Hz]
  double share = 0.0;      ///< [1] of the largest gain of the tip
  double error = 1.0;      ///< [1] relative, of the gain (of 1 / stiffness); 1: not shown
  double std = 0.0;        ///< [1] stated, over the true gain; 0: none
};

struct OffsetOutcome {
  std::vector<GainError> modes[WAYS];
  FrequencyResponse frf[WAYS], truth;
  double frf_error[WAYS] = {};  ///< [1] norm of the error over the norm, 100..5000 Hz
};

/// Measures with noise (a share of the rms) at one height and at two, and corrects. @throws Error when no
/// mode is found
OffsetOutcome judgeOffset(const OffsetCase& drawn, double noise, std::mt19937_64& random);

}  // namespace smartmill::studies
