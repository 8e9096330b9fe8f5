#include "smartmill_core/io/sound_file.h"

#include <sndfile.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <sstream>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

struct Closer {
  void operator()(SNDFILE* file) const { sf_close(file); }
};
using Handle = std::unique_ptr<SNDFILE, Closer>;

}  // namespace

bool isSoundFile(const std::string& file) {
  std::string ending = std::filesystem::path(file).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  for (const char* known : {".wav", ".flac", ".aif", ".aiff", ".ogg"})
    if (ending == known) return true;
  return false;
}

SoundFile readSoundFile(const std::string& file) {
  SF_INFO info{};
  const Handle handle(sf_open(file.c_str(), SFM_READ, &info));
  if (!handle) throw Error(file + ": cannot be read as a sound file: " + sf_strerror(nullptr));
  if (info.channels < 1 || info.samplerate < 1) throw Error(file + ": has no channels");
  SoundFile sound;
  sound.sample_rate = info.samplerate;
  sound.channels.resize(static_cast<std::size_t>(info.channels));
  // The length in the header may be wrong.
  constexpr sf_count_t PIECE = 16384;
  std::vector<double> piece(static_cast<std::size_t>(PIECE * info.channels));
  for (sf_count_t got = PIECE; got == PIECE;) {
    got = sf_readf_double(handle.get(), piece.data(), PIECE);
    for (sf_count_t i = 0; i < got; ++i)
      for (std::size_t c = 0; c < sound.channels.size(); ++c) {
        const double value = piece[static_cast<std::size_t>(i) * sound.channels.size() + c];
        if (!std::isfinite(value)) throw Error(file + ": contains a sample that is not a finite number");
        sound.channels[c].push_back(value);
      }
  }
  if (sound.channels[0].empty()) throw Error(file + ": has no samples");
  return sound;
}

std::vector<SoundChannel> soundChannels(const std::string& text) {
  std::vector<SoundChannel> channels;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    SoundChannel channel;
    const std::size_t colon = part.find(':'), equals = part.find('=');
    char rest = 0;
    const bool numbered = std::sscanf(part.c_str(), "%zu%c", &channel.number, &rest) == 2 && rest == ':';
    channel.name = colon < equals ? part.substr(colon + 1, equals - colon - 1) : "";
    const bool scaled = equals == std::string::npos ||
                        (std::sscanf(part.c_str() + equals + 1, "%lf%c", &channel.scale, &rest) == 1 &&
                         channel.scale != 0.0 && std::isfinite(channel.scale));
    if (!numbered || channel.number < 1 || channel.name.empty() || !scaled)
      throw Error("channel '" + part + "': expected NUMBER:NAME=SCALE, the number from 1, the scale not 0");
    channels.push_back(channel);
  }
  if (channels.empty()) throw Error("channels: expected NUMBER:NAME=SCALE,...");
  return channels;
}

void writeWav(const SoundFile& sound, const std::string& file) {
  SF_INFO info{};
  info.channels = static_cast<int>(sound.channels.size());
  info.samplerate = static_cast<int>(std::lround(sound.sample_rate));
  info.format = SF_FORMAT_WAV | SF_FORMAT_PCM_24;
  const Handle handle(sf_open(file.c_str(), SFM_WRITE, &info));
  if (!handle) throw Error(file + ": cannot be written: " + sf_strerror(nullptr));
  std::vector<double> interleaved;
  for (std::size_t i = 0; i < sound.channels.at(0).size(); ++i)
    for (const std::vector<double>& channel : sound.channels) interleaved.push_back(channel[i]);
  const auto frames = static_cast<sf_count_t>(sound.channels[0].size());
  if (sf_writef_double(handle.get(), interleaved.data(), frames) != frames)
    throw Error(file + ": cannot be written: " + sf_strerror(handle.get()));
}

}  // namespace smartmill
