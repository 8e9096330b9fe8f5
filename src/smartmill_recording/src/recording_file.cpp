#include "smartmill_recording/recording_file.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <utility>

#include "bag_file.h"
#include "mcap_file.h"
#include "smartmill_core/error.h"

namespace smartmill {

namespace {

enum class Format { unknown, bag, mcap };

Format formatOf(const std::string& begin) {
  if (begin.rfind(BAG_VERSION_LINE, 0) == 0) return Format::bag;
  return begin.compare(0, MCAP_MAGIC_SIZE, MCAP_MAGIC, MCAP_MAGIC_SIZE) == 0 ? Format::mcap : Format::unknown;
}

const std::size_t LONGEST = std::string(BAG_VERSION_LINE).size();  // [byte] that decide the format

}  // namespace

std::unique_ptr<RecordingFile> openRecording(const std::string& path, RecordingEnd end) {
  return openRecording(bytesOfFile(path), path, end);
}

std::unique_ptr<RecordingFile> openRecording(RecordingBytes bytes, const std::string& name,
                                             RecordingEnd end) {
  std::string begin(static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size, LONGEST)), '\0');
  bytes.read(0, begin.data(), begin.size());
  switch (formatOf(begin)) {
    case Format::bag:
      return openBag(std::move(bytes), name, end);
    case Format::mcap:
      return openMcap(std::move(bytes), name, end);
    default:
      throw Error(name + ": is neither a bag of version 2.0 nor an MCAP file (by its first bytes)");
  }
}

bool isRecording(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::string begin(LONGEST, '\0');
  if (stream.read(begin.data(), 1)) {
    stream.read(begin.data() + 1, static_cast<std::streamsize>(begin.size() - 1));
    if (formatOf(begin) != Format::unknown) return true;
  }
  const std::string ending = std::filesystem::path(path).extension().string();
  return ending == ".bag" || ending == ".mcap";
}

}  // namespace smartmill
