#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "smartmill_stability/chatter/recording.h"

namespace smartmill::stability {

/// Options of a recorded cut: file, channels, and data of the cut.
struct RecordingOptions {
  std::string file, model, topic, picture, idle;
  std::vector<std::string> channels;
  double rpm = 0.0, speed_error = 2.0, from = 0.0, to = INFINITY;
  int teeth = 0;
};

/// Channels of a sound file, a CSV file with a time column, or a topic of a bag, from `from` to `to` [s].
/// @throws Error naming the file and the fault.
Recording loadRecording(const RecordingOptions& options);

/// judgeRecording() of a file. @throws Error naming the file and the fault.
RecordingVerdict judgeFile(const RecordingOptions& options, const RecordingRequest& request);

}  // namespace smartmill::stability
