#pragma once

#include <string>
#include <vector>

namespace smartmill {

/// Channels of a sound file, or of any recorder that writes such files.
struct SoundFile {
  double sample_rate = 0.0;                   ///< [Hz]
  std::vector<std::vector<double>> channels;  ///< [1] of full scale
};

/// Whether its extension is one of .wav, .flac, .aif, .aiff, .ogg.
bool isSoundFile(const std::string& file);

/// WAV of any width, FLAC, AIFF, Ogg (libsndfile). @throws Error naming the file: missing, not a sound file,
/// without samples.
SoundFile readSoundFile(const std::string& file);

/// A channel of a sound file as a physical quantity.
struct SoundChannel {
  std::string name;        ///< e.g. fx, hammer, acceleration
  std::size_t number = 0;  ///< from 1
  double scale = 1.0;      ///< [unit] at full scale, with its sign
};

/// "1:hammer=2000,2:acceleration=-500": number, name and full scale in SI units; "=" and the scale may be
/// omitted. @throws Error naming the wrong item.
std::vector<SoundChannel> soundChannels(const std::string& text);

/// Writes 24-bit samples. @throws Error naming the file.
void writeWav(const SoundFile& sound, const std::string& file);

}  // namespace smartmill
