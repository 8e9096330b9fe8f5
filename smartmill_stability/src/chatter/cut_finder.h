#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_stability/chatter/recording.h"

namespace smartmill::stability {

/// Separation of a recording into cut and air.
struct CutFinderOptions {
  double lowest = 80.0, highest = 6000.0;  ///< [Hz] band: hum and rumble below; hiss and converters above
  double turns = 32.0;                     ///< revolutions of a window, which separate chatter from harmonics
  /// [s] Limits of a window: short enough to resolve a cut, long enough for lines of 12 Hz.
  double least_window = 0.08, longest_window = 0.8;
  double least_turns = 12.0;    ///< revolutions of a window that resolves lines between the harmonics
  int least_windows = 5;        ///< of a recording, for a level of cut and air
  double contrast = 1.8;        ///< [1] least power of the cut over that of the rest; noise varies less
  double tooth_contrast = 3.0;  ///< [1] the same of the tooth passing harmonics: vibration may grow in a cut
  double least_cut = 0.5;    ///< [s] of the cut without tooth passing harmonics; a slamming door is shorter
  double least_part = 0.12;  ///< [1] least fraction of the windows of either kind
  double main_lobe = 3.5;    ///< [lines] half width of the main lobe, Blackman-Harris
  double present = 30.0;     ///< [1] least power of a tooth passing harmonic over the noise floor
};

/// Finds the cut of a recording.
class CutFinder {
 public:
  /// A recording too short for several windows is one window in the cut.
  /// @param request with the actual speed
  CutFinder(const Recording& recording, const RecordingRequest& request);

  /// [s] Length of the windows of a recording. @param speed [rad/s]
  static double windowOf(const Recording& recording, double speed);

  double from() const;                       ///< [s] first window in the cut
  double to() const;                         ///< [s] last window in the cut
  bool hasAir() const { return has_air_; }   ///< the recording contains windows outside the cut
  bool hasToothPassing() const;              ///< tooth passing harmonics are present
  double window() const { return window_; }  ///< [s]
  const Spectrogram& spectrogram() const { return spectrogram_; }
  /// Whether all windows that overlap an interval of time [s] are in the cut, or all outside.
  bool within(bool cut, double from, double to) const;

 private:
  void findCut();
  bool loudFromTeeth() const;
  double longestLoud() const;
  bool isIdle(const std::vector<double>& power) const;
  std::vector<double> mean(bool cut) const;
  std::size_t lineAt(double frequency) const;

  CutFinderOptions options_;
  RecordingRequest request_;
  Spectrogram spectrogram_;
  double window_ = 0.0, step_ = 0.0;  // [s], [Hz] between lines
  bool has_air_ = false;
  std::vector<bool> cut_;               // [window]
  std::vector<double> in_cut_, floor_;  // mean power of each line and noise floor
};

}  // namespace smartmill::stability
