#include "smartmill_recording/import/channel_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "import/isolated.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/sound_file.h"
#include "smartmill_core/io/uff.h"
#include "smartmill_recording/import/names.h"
#include "smartmill_recording/import/unit.h"

namespace smartmill::recording {
namespace {

namespace fs = std::filesystem;

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(" \t") + 1 - begin);
}

bool begins(const std::string& text, const std::string& with) {
  return text.compare(0, with.size(), with) == 0;
}

const char* nameOf(const UffFunction& f) {
  static const char* const forces[] = {"", "fx", "fy", "fz"};
  const int axis = std::abs(f.response_direction);
  switch (f.numerator) {
    case uff::EXCITATION_FORCE:
      return "hammer";
    case uff::ACCELERATION:
      return "acceleration";
    case uff::DISPLACEMENT:
      return "displacement";
    case uff::REACTION_FORCE:
      return axis >= 1 && axis <= 3 ? forces[axis] : "";
    default:
      return "";
  }
}

}  // namespace

const FileChannel* ChannelFile::find(const std::string& name) const {
  const auto at = std::find_if(channels.begin(), channels.end(),
                               [&](const FileChannel& channel) { return channel.name == name; });
  return at == channels.end() ? nullptr : &*at;
}

FileKind fileKind(const std::string& path) {
  if (fs::is_directory(path)) {
    if (fs::exists(fs::path(path) / "campaign.yaml")) return FileKind::campaign;
    throw Error(path + ": a folder without campaign.yaml");
  }
  if (fs::path(path).filename() == "campaign.yaml") return FileKind::campaign;
  std::ifstream stream(path, std::ios::binary);
  std::array<char, 1024> bytes{};
  stream.read(bytes.data(), bytes.size());
  if (!stream && !stream.eof()) throw Error(path + ": cannot be read");
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
    if (!result.find("time")) result.channels.push_back({"time", "s", f.abscissa});
    const FileChannel& time = *result.find("time");
    if (f.abscissa.size() != time.values.size() ||
        f.abscissa[1] - f.abscissa[0] != time.values[1] - time.values[0])
      throw Error(file + ": function " + std::to_string(number) +
                  ": its times differ from those of the first; one "
                  "record per file is expected");
    const std::string known = nameOf(f);
    FileChannel channel{known.empty() ? trimmed(f.name) : known, trimmed(f.unit), {}};
    if (channel.name.empty() || result.find(channel.name))
      channel.name = (channel.name.empty() ? "function" : channel.name) + ":" + std::to_string(number);
    for (const std::complex<double>& v : f.value) channel.values.push_back(v.real());
    result.channels.push_back(std::move(channel));
  }
  if (result.channels.empty()) throw Error(file + ": no function over time");
  return result;
}

void takeSampleRate(ChannelFile& file) {
  struct Name {
    const char* name;
    bool step;
  };
  for (const Name& known :
       {Name{"samplerate", false}, Name{"sampleratehz", false}, Name{"samplingrate", false},
        Name{"samplingratehz", false}, Name{"samplingfrequency", false}, Name{"samplefrequency", false},
        Name{"fs", false}, Name{"fshz", false}, Name{"dt", true}, Name{"dts", true}}) {
    if (file.sample_rate) return;
    for (const auto& [name, value] : file.numbers) {
      if (plainName(name) != known.name) continue;
      if (!(value > 0.0) || !std::isfinite(value))
        throw Error(file.file + ": " + name + ": a sample rate or step above 0 is expected");
      file.sample_rate = known.step ? 1.0 / value : value;
      file.sample_rate_from = name;
      break;
    }
  }
}

void takeUnit(FileChannel& channel) {
  if (!channel.unit.empty()) return;
  std::string& name = channel.name;
  const auto split = [&](std::size_t end, std::size_t begin, std::size_t length) {
    channel.unit = trimmed(name.substr(begin, length));
    name = trimmed(name.substr(0, end));
  };
  const std::string closing = "])}>";
  const std::size_t kind = name.empty() ? std::string::npos : closing.find(name.back());
  if (kind != std::string::npos) {
    const std::size_t open = name.rfind("[({<"[kind]);
    if (open != std::string::npos && open > 0) {
      split(open, open + 1, name.size() - open - 2);
      return;
    }
  }
  for (const char* sign : {" / ", " in ", "_"}) {
    const std::size_t at = name.find(sign, 1);
    const std::size_t behind = at == std::string::npos ? at : at + std::string(sign).size();
    if (at == std::string::npos || !unitOf(trimmed(name.substr(behind)))) continue;
    split(at, behind, std::string::npos);
    return;
  }
  const std::size_t last = name.rfind('_');
  if (last != std::string::npos && last > 0 && unitOf(name.substr(last + 1)))
    split(last, last + 1, std::string::npos);
}

}  // namespace smartmill::recording
