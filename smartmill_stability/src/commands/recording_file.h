#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "smartmill_stability/chatter/recording.h"

namespace smartmill::stability {

/// A recording of a cut and what is known of the cut.
struct RecordingOptions {
  std::string file, model, topic, picture;
  std::vector<std::string> channels;
  double rpm = 0.0, speed_error = 2.0, from = 0.0, to = INFINITY;
  int teeth = 0;
};

/// The named channels of a sound file, a CSV with a column of time, or a topic of a bag, from `from` to `to`.
/// @throws Error naming the file and what is wrong with it.
Recording loadRecording(const RecordingOptions& options);

}  // namespace smartmill::stability
