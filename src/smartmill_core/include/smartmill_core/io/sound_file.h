#pragma once

#include <string>
#include <vector>

namespace smartmill {

/// What a sound recorder, or any recorder that writes such files, has kept.
struct SoundFile {
  double sample_rate = 0.0;                   ///< [Hz]
  std::vector<std::vector<double>> channels;  ///< [1] of full scale
};

/// Whether its ending says so: .wav, .flac, .aif, .aiff, .ogg.
bool isSoundFile(const std::string& file);

/// WAV of any width, FLAC, AIFF, Ogg (libsndfile). @throws Error naming the file: missing, no sound file,
/// without samples.
SoundFile readSoundFile(const std::string& file);

/// A channel of a sound file as a quantity.
struct SoundChannel {
  std::string name;        ///< e.g. fx, hammer, acceleration
  std::size_t number = 0;  ///< from 1
  double scale = 1.0;      ///< [unit] at full scale, with its sign
};

/// "1:hammer=2000,2:acceleration=-500": number, name and what full scale is in SI units; "=" and the scale
/// may be left out. @throws Error naming the part that is wrong.
std::vector<SoundChannel> soundChannels(const std::string& text);

/// Writes 24 bits. @throws Error naming the file.
void writeWav(const SoundFile& sound, const std::string& file);

}  // namespace smartmill
