#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "smartmill_core/signal/hit.h"

namespace smartmill::hammer {

/// Fault of a drawn record.
enum class HitClass {
  clean,         ///< one hit
  clean_group,   ///< four to eight hits of one point
  double_hit,    ///< a second contact of 20..60 % begins 0.5..3 ms after the first
  clipping,      ///< at 40..90 % of the largest, by the converter or by an amplifier before it
  dropout,       ///< one to three samples or pairs wrong by at least 20 % of the largest
  drift,         ///< force or response ends with an error of 5..30 % of its largest
  stuck,         ///< ten and more samples in motion have one value
  late_bump,     ///< another excitation after the hit
  weak,          ///< below the limit, or 2..7 times the noise
  dull,          ///< the force falls to 1.5 % of its largest line inside the band
  trigger_skew,  ///< of four to eight hits one has a delay of 0.6..4 samples between its channels
  gain_jump      ///< of four to eight hits one has 1.15..2.5 times the gain, or one over that
};
constexpr int HIT_CLASSES = 12;
std::string nameOf(HitClass kind);

/// A drawn case: input of the hit check.
struct HitCase {
  std::vector<Hit> hits;
  std::size_t at_fault = 0;  ///< index of the hit; undefined where all are clean
  double weak_force = 0.0;   ///< [N] limit; 0: none
  double high = 0.0;         ///< [Hz] band; 0: none
};

/// Record(s) of a class, independent of the analysis under test: modes are integrated in closed form under
/// asymmetric pulses (power laws with a ripple, ringing of the force cell), displacement,
/// acceleration or a gap sensor's voltage, 20..51.2 kHz, one to five modes (some 2 % apart), noise, hum,
/// offsets and steps of the converter. A given class and seed make the same records on every machine with the
/// same library of distributions.
HitCase drawHitCase(HitClass kind, std::uint64_t seed);

}  // namespace smartmill::hammer
