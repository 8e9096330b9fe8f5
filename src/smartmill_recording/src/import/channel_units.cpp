#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_recording/import/channel_file.h"
#include "smartmill_recording/import/names.h"
#include "smartmill_recording/import/unit.h"

namespace smartmill::recording {

const FileChannel* ChannelFile::find(const std::string& name) const {
  const auto at = std::find_if(channels.begin(), channels.end(),
                               [&](const FileChannel& channel) { return channel.name == name; });
  return at == channels.end() ? nullptr : &*at;
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
      const double rate = known.step ? 1.0 / value : value;
      if (!(value > 0.0) || !std::isfinite(rate))
        throw Error(file.file + ": " + name + ": expected a sample rate or step above 0");
      file.sample_rate = rate;
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
