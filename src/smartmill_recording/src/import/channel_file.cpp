#include "smartmill_recording/import/channel_file.h"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>

#include "import/isolated.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/sound_file.h"
#include "smartmill_core/io/uff.h"
#include "smartmill_recording/import/names.h"

namespace smartmill::recording {
namespace {

namespace fs = std::filesystem;

bool begins(const std::string& text, const std::string& with) {
  return text.compare(0, with.size(), with) == 0;
}

const char* nameOf(const UffFunction& f) {
  static const char* const forces[] = {"", "fx", "fy", "fz"};
  const bool known = f.response_direction >= -3 && f.response_direction <= 3;
  const int axis = known ? std::abs(f.response_direction) : 0;
  switch (f.numerator) {
    case uff::EXCITATION_FORCE:
      return "hammer";
    case uff::ACCELERATION:
      return "acceleration";
    case uff::DISPLACEMENT:
      return "displacement";
    case uff::REACTION_FORCE:
      return forces[axis];
    default:
      return "";
  }
}

}  // namespace

FileKind fileKind(const std::string& path) {
  if (fs::is_directory(path)) {
    if (fs::exists(fs::path(path) / "campaign.yaml")) return FileKind::campaign;
    throw Error(path + ": a folder without campaign.yaml");
  }
  if (fs::path(path).filename() == "campaign.yaml") return FileKind::campaign;
  std::ifstream stream(path, std::ios::binary);
  std::array<char, 1024> bytes{};
  stream.read(bytes.data(), bytes.size());
  if (!stream && !stream.eof()) throw Error(path + ": cannot be read: " + std::strerror(errno));
  const std::string head(bytes.data(), static_cast<std::size_t>(stream.gcount()));
  if (head.empty()) throw Error(path + ": is empty");
  const std::string hdf5 = "\x89HDF\r\n\x1a\n";
  if (begins(head, "MATLAB 5.0") || begins(head, "MATLAB 7.")) return FileKind::mat;
  if (begins(head, hdf5)) return FileKind::hdf5;
  constexpr std::size_t USER_BLOCK = 512;
  if (head.size() > USER_BLOCK && begins(head.substr(USER_BLOCK), hdf5)) return FileKind::hdf5;
  if (begins(head, "#ROSBAG V")) return FileKind::bag;
  if (begins(head, "\x89MCAP0\r\n")) return FileKind::mcap;
  if (begins(head, "TDSm") || fs::path(path).extension() == ".tdms")
    throw Error(path + ": TDMS files are not supported; export as CSV, MAT or HDF5");
  if (isSoundFile(path) || begins(head, "RIFF") || begins(head, "fLaC")) return FileKind::sound;
  if (begins(head, "\xFF\xFE") || begins(head, "\xFE\xFF"))
    throw Error(path + ": UTF-16 text; save it as UTF-8");
  if (isUff(path)) return FileKind::uff;
  if (fs::path(path).extension() == ".mat") throw Error(path + ": not a MATLAB file of version 5, 7 or 7.3");
  if (head.find('\0') != std::string::npos) throw Error(path + ": binary data of an unknown format");
  return FileKind::text;
}

ChannelFile readChannelFile(const std::string& file) {
  ChannelFile result;
  switch (fileKind(file)) {
    case FileKind::mat:
      result = readIsolated(file, readMatFile);
      break;
    case FileKind::hdf5:
      result = readIsolated(file, readHdf5File);
      break;
    case FileKind::sound:
      result = readSoundChannels(file);
      break;
    case FileKind::uff:
      result = readUffChannels(file);
      break;
    case FileKind::text:
      result = readTextTable(file);
      break;
    default:
      throw Error(file + ": a recording or a campaign; expected a file of channels");
  }
  for (FileChannel& channel : result.channels) takeUnit(channel);
  takeSampleRate(result);
  return result;
}

ChannelFile readSoundChannels(const std::string& file) {
  SoundFile sound = readSoundFile(file);
  ChannelFile result;
  result.file = file;
  result.kind = "sound";
  result.sample_rate = sound.sample_rate;
  result.sample_rate_from = "the file's header";
  for (std::vector<double>& values : sound.channels)
    result.channels.push_back({std::to_string(result.channels.size() + 1), "full_scale", std::move(values)});
  return result;
}

ChannelFile readUffChannels(const std::string& file) {
  ChannelFile result;
  result.file = file;
  result.kind = "universal file 58";
  std::set<std::string> names{"time"};
  int number = 0;
  for (const UffFunction& f : readUff(file)) {
    ++number;
    if (f.type != uff::TIME_RESPONSE) {
      result.notes.push_back("function " + std::to_string(number) + " (" + f.name +
                             "): not over time, not read");
      continue;
    }
    if (f.abscissa.size() < 2)
      throw Error(file + ": function " + std::to_string(number) + ": fewer than two values");
    if (result.channels.empty()) result.channels.push_back({"time", "s", f.abscissa});
    const std::vector<double>& time = result.channels.front().values;
    if (f.abscissa.size() != time.size() || f.abscissa[1] - f.abscissa[0] != time[1] - time[0])
      throw Error(file + ": function " + std::to_string(number) +
                  ": its times differ from those of the first; expected one record per file");
    const std::string known = nameOf(f);
    FileChannel channel{known.empty() ? trimmed(f.name) : known, trimmed(f.unit), {}};
    if (channel.name.empty()) channel.name = "function";
    if (!names.insert(channel.name).second) channel.name += ":" + std::to_string(number);
    for (const std::complex<double>& v : f.value) channel.values.push_back(v.real());
    result.channels.push_back(std::move(channel));
  }
  if (result.channels.empty()) throw Error(file + ": no function over time");
  return result;
}

}  // namespace smartmill::recording
