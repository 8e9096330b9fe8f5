#pragma once

#include <functional>
#include <string>

#include "smartmill_recording/import/channel_file.h"

namespace smartmill::recording {

/// Reads a file in a process of its own: libhdf5 and libmatio can crash on a damaged file.
/// @throws Error what the reader throws, or "FILE: damaged: ..." where the process ended without an answer.
ChannelFile readIsolated(const std::string& file, const std::function<ChannelFile(const std::string&)>& read);

}  // namespace smartmill::recording
