#pragma once

#include <limits>
#include <string>
#include <vector>

namespace smartmill::stability {

/// Evenly sampled channels of a cut from any sensor.
struct Recording {
  double sample_rate = 0.0;                   ///< [Hz]
  std::vector<std::vector<double>> channels;  ///< each in its own unit
  double start = 0.0;                         ///< [s] of the first sample; times of the verdict include it
};

struct RecordingRequest {
  double speed = 0.0;  ///< [rad/s] approximate spindle speed in the cut
  int teeth = 0;
  double speed_error = 0.02;  ///< [1] largest relative error of speed
  std::vector<double> modes;  ///< [Hz] natural frequencies of tool and spindle; empty: unknown
  /// @throws Error naming the quantity.
  void validate() const;
};

/// Power over time and frequency.
struct Spectrogram {
  std::vector<double> time;       ///< [s] middle of each window
  std::vector<double> frequency;  ///< [Hz]
  /// [window][line] sum over the channels, each normalised by its mean square
  std::vector<std::vector<double>> power;
};

/// Result of judgeRecording().
struct RecordingVerdict {
  static constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();
  /// Whether the recording contains a cut: a louder part, or a constant level with lines at the tooth passing
  /// frequency.
  bool cut = false;
  bool chatter = false;
  double speed = 0.0;           ///< [rad/s] corrected from the harmonics
  double from = 0.0, to = 0.0;  ///< [s] first and last window with a cut
  double frequency = UNKNOWN;   ///< [Hz] strongest chatter line
  double over_noise = UNKNOWN;  ///< [dB] of that line over the noise floor around it
  double over_air = UNKNOWN;    ///< [dB] of that line over the same line outside the cut; NaN: no such part
  int companions = 0;           ///< lines an integer number of tooth passing frequencies away
  double share = 0.0;           ///< [1] power of the chatter lines over that of the spindle harmonics
  double mode = UNKNOWN;        ///< [Hz] nearby mode; NaN: none is known
  std::string reason;           ///< why there is no chatter or no cut
  Spectrogram spectrogram;
  /// One line.
  std::string text() const;
};

/// Detects chatter in a recorded cut without a tachometer. Chatter is a narrow line that
/// - is not a spindle harmonic (the speed is corrected from the harmonics),
/// - is present only while the tool cuts, and in most windows of the cut at the same frequency,
/// - has companions an integer number of tooth passing frequencies away, because the teeth sample the
///   vibration (Insperger, Stepan et al.: chatter frequencies of a time-periodic process),
/// - lies near a mode with its family, where modes are known.
/// This excludes broadband noise of chips and load, a tone of another machine (present outside the cut,
/// without companions) and a spindle run-up (no steady line). A flip of a tool with an even number of teeth
/// lies on the spindle harmonics and is not distinguished from runout.
/// @throws Error of RecordingRequest::validate(), and on a recording that is too short.
RecordingVerdict judgeRecording(const Recording& recording, const RecordingRequest& request);

}  // namespace smartmill::stability
