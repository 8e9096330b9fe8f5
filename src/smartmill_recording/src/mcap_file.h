#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "smartmill_recording/recording_file.h"

namespace smartmill {

/// What an MCAP file begins and ends with.
constexpr const char MCAP_MAGIC[] = "\x89MCAP0\r\n";
constexpr std::size_t MCAP_MAGIC_SIZE = sizeof MCAP_MAGIC - 1;

/// Encodings of the profile ros1.
constexpr const char* MCAP_PROFILE = "ros1";
constexpr const char* MCAP_MESSAGE_ENCODING = "ros1";
constexpr const char* MCAP_SCHEMA_ENCODING = "ros1msg";

/// Codes of an MCAP file's records.
enum class McapOp : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  statistics = 0x0B,
  summary_offset = 0x0E,
  data_end = 0x0F
};

/// [byte] a record's code and length
constexpr std::size_t MCAP_RECORD_HEAD = 9;
/// [byte] a message record's fields before its data
constexpr std::size_t MCAP_MESSAGE_HEAD = 22;

/// An MCAP file (mcap.dev/spec). @throws Error as openRecording()
std::unique_ptr<RecordingFile> openMcap(RecordingBytes bytes, const std::string& name, RecordingEnd end);

}  // namespace smartmill
