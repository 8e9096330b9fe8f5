#include "smartmill_recording/reading_progress.h"

#include <unistd.h>

#include <cstdio>

namespace smartmill {

void printReadingProgress(double share) {
  static const bool terminal = isatty(STDERR_FILENO) != 0;
  if (terminal) std::fprintf(stderr, "\rreading %3.0f %%%s", 100.0 * share, share >= 1.0 ? "\n" : "");
}

}  // namespace smartmill
