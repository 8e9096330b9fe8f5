#pragma once

namespace smartmill {

/// Exit status of a program that Ctrl-C has interrupted.
constexpr int INTERRUPTED = 130;

/// SIGINT and SIGTERM set stopRequested() instead of ending the process: for programs that run until they are
/// stopped.
void catchStopSignals();
/// The first SIGINT sets stopRequested(), the second ends the process: for work whose result so far is kept.
/// @param line to standard error at the first one, static, with its end of line
void catchInterrupt(const char* line = "");
bool stopRequested();

}  // namespace smartmill
