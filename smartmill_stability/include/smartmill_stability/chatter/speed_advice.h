#pragma once

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_stability/chatter/recording.h"
#include "smartmill_stability/chatter/speed_search.h"

namespace smartmill::stability {

/// Sound of a cut, or of a part of it.
struct CutSound {
  Recording cut;  ///< one channel, without air
  Recording air;  ///< the same microphone before the cut; without channels: not heard
  int teeth = 0;
  double speed = 0.0;  ///< [rad/s] stated; 0: unknown
};

/// judgeRecording() of a cut. Lines of the air are no chatter. Being louder than the air is no sign of a cut
/// here: a spindle that starts and coolant are, too; lines that are not in the air and a tooth passing
/// frequency apart are one.
RecordingVerdict judgeCut(const CutSound& sound);

/// A cut that was heard and judged.
struct SoundTry {
  using Kind = RecordingVerdict::Kind;
  double begin = 0.0, end = 0.0;  ///< [s]
  double speed = 0.0;             ///< [rad/s] by the harmonics; NaN: unknown
  Kind kind = Kind::unsure;
  double probability = RecordingVerdict::UNKNOWN;  ///< [1] of chatter; NaN without a cut
  double frequency = RecordingVerdict::UNKNOWN;    ///< [Hz] of the chatter
  double clipped = 0.0;                            ///< [1] share of the samples
  int parts = 0;                                   ///< judged parts with signs of a cut
  std::string text;                                ///< one line

  /// Adds the verdict on a further part of the cut: it chatters if a part does; otherwise the probability is
  /// the mean of the parts. A part without a cut changes nothing if another one has signs of it.
  void add(const RecordingVerdict& part);
  /// Chatter, or unsure and more probable than not, with a frequency.
  bool chatters() const {
    return kind == Kind::chatter || (kind == Kind::unsure && probability >= 0.5 && std::isfinite(frequency));
  }
  /// Whether the search of speeds uses it.
  bool decides() const { return (chatters() || kind == Kind::stable) && std::isfinite(speed); }
};

/// Speeds of the spindle [rad/s]; 0: half and twice the speed of the first cut that chatters.
struct SpeedRange {
  double low = 0.0, high = 0.0;
  /// @throws Error unless 0 < low < high or both 0.
  void validate() const;
};

struct SpeedAdvice {
  std::vector<SpeedProposal>
      speeds;  ///< first the one to try, then others by probability; empty: none is needed or known
  std::vector<bool> used;  ///< [try] whether it decides and is within the range
};

/// Feeds the tries in the order in which they were made to SpeedSearch. Cuts before the first that chatters
/// follow it, since the search begins with chatter. No speeds if the last deciding cut is stable, or none
/// chatters.
/// @throws Error on a range or a number of teeth out of bounds.
SpeedAdvice adviseSpeeds(int teeth, const SpeedRange& range, const std::vector<SoundTry>& tries);

}  // namespace smartmill::stability
