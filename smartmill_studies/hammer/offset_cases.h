#pragma once

#include <random>
#include <string>
#include <vector>

#include "plant/beam.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_hammer/analysis/tip_correction.h"

namespace smartmill::studies {

/// A tool in a spindle of the benches' plant (Euler beam on a rigid spindle with two springs; the correction
/// uses a shear beam on springs), its model as stated, and the offset of the station.
struct OffsetCase {
  plant::ToolInSpindle truth;
  hammer::ToolBeam believed;
  double offset = 0.0;  ///< [m] hammer above sensor
};
OffsetCase drawOffsetCase(std::mt19937_64& random);

/// FRF of 20..5500 Hz, 10 Hz lines, with force and response at heights above the tip [m], with noise (as
/// share of its RMS).
FrequencyResponse crossFrf(const plant::ToolInSpindle& tool, double struck, double read, double noise,
                           std::mt19937_64& random);

/// Methods to get the tip FRF from the measured cross FRF.
enum class TipMethod { none, thesis, one_height, two_heights };
constexpr int TIP_METHODS = 4;
std::string nameOf(TipMethod method);

/// Result of a method for one true mode below 5 kHz.
struct GainError {
  double frequency = 0.0;  ///< [Hz]
  double share = 0.0;      ///< [1] of the largest gain of the tip
  double error = 1.0;      ///< [1] relative, of the gain (1 / stiffness); 1: mode not found
  double std = 0.0;        ///< [1] stated standard deviation over the true gain; 0: none
};

struct OffsetOutcome {
  std::vector<GainError> modes[TIP_METHODS];
  FrequencyResponse frf[TIP_METHODS], truth;
  double frf_error[TIP_METHODS] = {};  ///< [1] norm of the error over the norm, 100..5000 Hz
};

/// Measures at one height and at two, with noise (share of the RMS), and corrects. @throws Error when no
/// mode is found
OffsetOutcome judgeOffset(const OffsetCase& drawn, double noise, std::mt19937_64& random);

}  // namespace smartmill::studies
