#pragma once

#include <memory>
#include <string>

#include "packing.h"
#include "smartmill_recording/recording_writer.h"

namespace smartmill {

/// An MCAP file of the profile ros1, in chunks with their indexes, with a summary and its offsets.
/// @param packing none, lz4 or zstd @throws Error
std::unique_ptr<RecordingWriter> createMcap(const std::string& path, Packing packing);

}  // namespace smartmill
