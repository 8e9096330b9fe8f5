#pragma once

#include <memory>
#include <string>

#include "smartmill_recording/recording_file.h"

namespace smartmill {

/// The line that every bag of format 2.0 begins with.
constexpr const char* BAG_VERSION_LINE = "#ROSBAG V2.0\n";

/// Operation codes of a bag's records.
enum class BagOp : std::uint8_t {
  message = 2,
  bag = 3,
  index = 4,
  chunk = 5,
  chunk_info = 6,
  connection = 7
};

/// A bag of format 2.0 (wiki.ros.org/Bags/Format/2.0). @throws Error as openRecording()
std::unique_ptr<RecordingFile> openBag(RecordingBytes bytes, const std::string& name, RecordingEnd end);

}  // namespace smartmill
