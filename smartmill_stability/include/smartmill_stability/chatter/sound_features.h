#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_core/signal/streams.h"

namespace smartmill::stability {

/// Sound of one frame (SoundFrames::SECONDS).
struct SoundFrame {
  double begin = 0.0;         ///< [s]
  std::vector<double> power;  ///< [unit2] mean square in each line of SoundFrames::step(), from line 0
  double loudness = 0.0;      ///< [unit2] mean square in the band of chatter detection
  double total = 0.0;         ///< [unit2] mean square from 50 Hz to 20 kHz
  std::size_t samples = 0, clipped = 0;
};

/// Cuts a stream of samples into frames without overlap and computes their spectra (Hann window).
class SoundFrames {
 public:
  static constexpr double SECONDS = 0.08;                    ///< of a frame: lines of 12.5 Hz
  static constexpr double LOWEST = 50.0, HIGHEST = 20000.0;  ///< [Hz] of total and features

  /// Begins anew. @param sample_rate [Hz]
  void reset(double sample_rate);
  /// @param time [s] of the sample @param clipped the sample was clipped; its value is that before it
  /// @return whether a frame is complete: frame()
  bool push(double time, double value, bool clipped);
  const SoundFrame& frame() const { return frame_; }
  double step() const { return step_; }  ///< [Hz] between lines

 private:
  std::vector<double> taper_, samples_;
  double step_ = 0.0, scale_ = 0.0, begin_ = 0.0;
  std::size_t clipped_ = 0;
  SoundFrame frame_;
};

/// What is stored of the sound: the mean power spectrum of several frames. Neither the phases nor the order
/// of the frames are contained, so that words are not.
struct SoundFeatures {
  double stamp = 0.0;            ///< [s] begin
  double duration = 0.0;         ///< [s]
  double level = 0.0;            ///< [unit] RMS from 50 Hz to 20 kHz
  double clipped = 0.0;          ///< [1] share of the samples
  double lowest = 0.0;           ///< [Hz] first line
  double step = 0.0;             ///< [Hz] between lines
  std::vector<float> amplitude;  ///< [unit] RMS of each line; their squares add up to that of level
};

/// Mean of the power spectra of six frames: two features a second.
class FeatureMaker {
 public:
  static constexpr std::size_t FRAMES = 6;

  void reset() { count_ = 0; }
  /// @param step [Hz] of the lines of the frame @return whether features() are new
  bool push(const SoundFrame& frame, double step);
  const SoundFeatures& features() const { return features_; }

 private:
  std::vector<double> power_;
  std::size_t count_ = 0, clipped_ = 0, samples_ = 0;
  double begin_ = 0.0;
  SoundFeatures features_;
};

}  // namespace smartmill::stability
