#pragma once

namespace smartmill {

/// Progress of a command that reads a recording: a line of standard error, if that is a terminal.
/// @param share 0..1 of the recording
void printReadingProgress(double share);

}  // namespace smartmill
