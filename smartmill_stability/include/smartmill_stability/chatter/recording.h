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
  /// Whether the channels have one unit, so that their energies are added. Otherwise each is divided by its
  /// standard deviation.
  bool same_unit = false;
};

struct RecordingRequest {
  double speed = 0.0;  ///< [rad/s] approximate spindle speed in the cut; 0: unknown, found from the harmonics
  int teeth = 0;
  double speed_error = 0.02;  ///< [1] largest relative error of speed
  std::vector<double> modes;  ///< [Hz] natural frequencies of tool and spindle; empty: unknown
  /// The idle spindle at the same speed, by the same sensor with the same gain: a cut is louder, and lines of
  /// the idle machine are no chatter. Without channels: not recorded.
  Recording idle{};
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
  /// [1] Verdicts between these probabilities of chatter are unsure.
  static constexpr double STABLE_BELOW = 0.2, CHATTER_ABOVE = 0.8;
  enum class Kind { no_cut, stable, chatter, unsure };
  /// Where the speed comes from: stated, or found since none is stated or the stated one does not agree with
  /// the harmonics.
  enum class SpeedSource { stated, found, corrected };

  Kind kind = Kind::unsure;
  double probability = UNKNOWN;  ///< [1] of chatter; NaN without a cut
  double margin = UNKNOWN;       ///< [1] mean ChatterEvidence::margin of the windows
  SpeedSource speed_source = SpeedSource::stated;
  /// Whether the recording contains a cut: a louder part, or a constant level with lines at the tooth passing
  /// frequency.
  bool cut = false;
  double speed = 0.0;           ///< [rad/s] corrected from the harmonics; NaN: neither stated nor found
  double from = 0.0, to = 0.0;  ///< [s] first and last window with a cut
  double frequency = UNKNOWN;   ///< [Hz] strongest chatter line
  double over_noise = UNKNOWN;  ///< [dB] of that line over the noise floor around it
  double over_air = UNKNOWN;    ///< [dB] of that line over the same line outside the cut; NaN: no such part
  double energy_ratio = 0.0;    ///< [1] energy outside the spindle harmonics over that of both
  int companions = 0;           ///< lines an integer number of tooth passing frequencies away
  double share = 0.0;           ///< [1] power of the chatter lines over that of the spindle harmonics
  double mode = UNKNOWN;        ///< [Hz] nearby mode; NaN: none is known
  std::string reason;           ///< why there is no chatter or no cut, or why it is not certain
  Spectrogram spectrogram;
  bool chatter() const { return kind == Kind::chatter; }
  /// One line.
  std::string text() const;
};

/// no_cut, stable, chatter, unsure.
const char* nameOf(RecordingVerdict::Kind kind);

/// Detects chatter in a recorded cut without a tachometer. Chatter is a narrow line that
/// - is not a spindle harmonic (the speed is corrected from the harmonics),
/// - is present only while the tool cuts, and in most windows of the cut at the same frequency,
/// - has companions an integer number of tooth passing frequencies away, because the teeth sample the
///   vibration (Insperger, Stepan et al.: chatter frequencies of a time-periodic process),
/// - lies near a mode with its family, where modes are known.
/// This excludes broadband noise of chips and load, a tone of another machine (present outside the cut,
/// without companions) and a spindle run-up (no steady line). A flip of a tool with an even number of teeth
/// lies on the spindle harmonics and is not distinguished from runout.
///
/// A recording of at least 36 revolutions is divided into windows, a shorter one, of three revolutions or
/// more, is one window with less certainty. The speed is found without being stated from twelve revolutions
/// on. At least two samples in a tooth passing period are required; with fewer than twelve, lines at aliased
/// tooth passing harmonics count nowhere. The probability is a logistic function of the mean margin of the
/// windows, fitted to simulated sounds (results.md, recordings); between 20 and 80 % the verdict is unsure.
/// @throws Error of RecordingRequest::validate(), and on a recording with fewer revolutions or samples.
RecordingVerdict judgeRecording(const Recording& recording, const RecordingRequest& request);

}  // namespace smartmill::stability
