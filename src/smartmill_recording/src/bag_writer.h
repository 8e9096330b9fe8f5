#pragma once

#include <memory>
#include <string>

#include "packing.h"
#include "smartmill_recording/recording_writer.h"

namespace smartmill {

/// A bag of format 2.0. @param packing none or lz4 @throws Error
std::unique_ptr<RecordingWriter> createBag(const std::string& path, Packing packing);

/// [byte] that the records of a chunk have before it is written
constexpr std::size_t CHUNK_TARGET = 1U << 20U;

}  // namespace smartmill
