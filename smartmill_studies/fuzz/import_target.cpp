#include <algorithm>
#include <string>

#include "fuzz/input_file.h"
#include "fuzz/targets.h"
#include "smartmill_recording/import/import_plan.h"

namespace smartmill::fuzz {

using namespace smartmill::recording;

void channels(const std::uint8_t* data, std::size_t size) {
  const std::uint8_t* const end = data + size;
  const std::uint8_t* const line_end = std::find(data, end, '\n');
  const std::string stated(data, line_end);
  const std::uint8_t* const table = line_end == end ? end : line_end + 1;
  const std::string& file = inputFile(table, static_cast<std::size_t>(end - table));
  readOrRefuse([&] {
    const ChannelChoices choices = channelChoices(stated);
    ChannelFile channels = readTextTable(file);
    for (FileChannel& channel : channels.channels) {
      takeUnit(channel);
      // As files with scalar values next to their channels: .mat, HDF5.
      channels.numbers[channel.name] = channel.values.front();
    }
    readOrRefuse([&] { mapChannels(channels, choices, TestKind::cut, 1000.0); });
    readOrRefuse([&] { mapChannels(channels, choices, TestKind::tap, std::nullopt); });
    takeSampleRate(channels);
    mapChannels(channels, choices, std::nullopt, std::nullopt);
  });
}

void import_plan(const std::uint8_t* data, std::size_t size) {
  const std::string& file = inputFile(data, size);
  readOrRefuse([&] { readImport(file).settingsOf("cut.csv"); });
}

}  // namespace smartmill::fuzz
