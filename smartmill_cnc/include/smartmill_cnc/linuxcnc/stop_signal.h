#pragma once

namespace smartmill::cnc::linuxcnc {

/// Installs handlers: SIGINT and SIGTERM set stopRequested() instead of ending the process.
void catchStopSignals();
bool stopRequested();

}  // namespace smartmill::cnc::linuxcnc
