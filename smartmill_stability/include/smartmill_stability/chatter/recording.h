#pragma once

#include <limits>
#include <string>
#include <vector>

namespace smartmill::stability {

/// Evenly sampled channels of a cut, of whatever sensor.
struct Recording {
  double sample_rate = 0.0;                   ///< [Hz]
  std::vector<std::vector<double>> channels;  ///< each in a unit of its own
};

struct RecordingRequest {
  double speed = 0.0;  ///< [rad/s] of the spindle in the cut, as far as it is known
  int teeth = 0;
  double speed_error = 0.02;  ///< [1] it may be so much off
  std::vector<double> modes;  ///< [Hz] natural frequencies of tool and spindle; empty: not known
  /// @throws Error naming the quantity.
  void validate() const;
};

/// Power over time and frequency.
struct Spectrogram {
  std::vector<double> time;       ///< [s] middle of each window
  std::vector<double> frequency;  ///< [Hz]
  std::vector<std::vector<double>>
      power;  ///< [window][line], channels together, each over its own mean square
};

/// What a recording says.
struct RecordingVerdict {
  static constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();
  bool cut = false;  ///< something is louder than the rest, or as loud throughout and in step with the teeth
  bool chatter = false;
  double speed = 0.0;           ///< [rad/s] that the harmonics show
  double from = 0.0, to = 0.0;  ///< [s] of the (first and last) cut
  double frequency = UNKNOWN;   ///< [Hz] strongest line of the chatter
  double over_noise = UNKNOWN;  ///< [dB] of that line, over what is beside it
  double over_air = UNKNOWN;    ///< [dB] and over the same line out of the cut; NaN: all of it is cut
  int companions = 0;           ///< lines a whole number of tooth passings away from it
  double share = 0.0;           ///< [1] of chatter's lines over those of the spindle's harmonics
  double mode = UNKNOWN;        ///< [Hz] the mode it is near; NaN: none is known
  std::string reason;           ///< why it is chatter, or is not
  Spectrogram spectrogram;
  /// One line.
  std::string text() const;
};

/// Judges a recorded cut without a tachometer. Chatter is a narrow line that is no harmonic of the spindle
/// (whose speed the harmonics themselves correct), that lives only while the tool cuts, stands in most of the
/// cut's windows at the same frequency, and has companions a whole number of tooth passings away, since the
/// teeth sample the vibration (Insperger, Stepan and others: the chatter frequencies of a time-periodic
/// process); where modes are known one of these lines lies near a mode. So broadband noise of chip and load
/// is none (wide), nor a tone of another machine (it sounds out of the cut too, and alone), nor a spindle
/// that runs up (no steady line). A flip of an even number of teeth lies on the spindle's harmonics and is
/// not told from runout here. @throws Error of RecordingRequest::validate(), or on a recording too short.
RecordingVerdict judgeRecording(const Recording& recording, const RecordingRequest& request);

}  // namespace smartmill::stability
