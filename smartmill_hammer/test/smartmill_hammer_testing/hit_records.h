#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "smartmill_core/signal/hit.h"

namespace smartmill {
namespace hammer {

/// What is wrong with a drawn record.
enum class HitClass {
  clean,         ///< one hit
  clean_beside,  ///< four to eight hits of one point
  double_hit,    ///< a second contact of 20..60 % begins 0.5..3 ms after the first
  clipping,      ///< at 40..90 % of the largest, by the converter or by an amplifier before it
  dropout,       ///< one to three samples or pairs off by at least 20 % of the largest
  drift,         ///< the force or the response ends 5..30 % of its largest off
  stuck,         ///< ten and more samples in motion hold one value
  late_bump,     ///< something else moves the structure later
  weak,          ///< below the limit asked, or 2..7 times the noise
  dull,          ///< the force falls to 1.5 % of its largest line inside the asked band
  trigger_skew,  ///< of four to eight hits one has its channels apart by 0.6..4 samples
  gain_jump      ///< of four to eight hits one has 1.15..2.5 times the gain, or that much less
};
constexpr int HIT_CLASSES = 12;
std::string nameOf(HitClass kind);

/// A drawn case: what the judge is shown.
struct HitCase {
  std::vector<Hit> hits;
  std::size_t at_fault = 0;  ///< of the hits; without meaning where all are clean
  double weak_force = 0.0;   ///< [N] asked; 0: not
  double high = 0.0;         ///< [Hz] asked; 0: not
};

/// Record(s) of a class. Nothing of the product's analysis takes part: modes are stepped by their own closed
/// form under pulses of uneven shape (power laws with a ripple, the force cell ringing after), displacement,
/// acceleration or a gap sensor's voltage, 20..51.2 kHz, one to five modes (some 2 % apart), noise, hum,
/// offsets and steps of the converter. A given class and seed make the same records on every machine with the
/// same library of distributions.
HitCase drawHitCase(HitClass kind, std::uint64_t seed);

}  // namespace hammer
}  // namespace smartmill
