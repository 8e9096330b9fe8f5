#pragma once

namespace smartmill::cnc::linuxcnc {

/// From here on SIGINT and SIGTERM ask for the program's end instead of ending it.
void catchStopSignals();
bool stopRequested();

}  // namespace smartmill::cnc::linuxcnc
