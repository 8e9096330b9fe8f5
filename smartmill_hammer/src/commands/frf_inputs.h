#pragma once

#include <vector>

#include "commands/frf_results.h"
#include "smartmill_hammer/analysis/tap_records.h"

namespace smartmill::hammer {

struct Frfs {
  std::vector<NamedFrf> frfs;
  double truncated_length = 0.0;  // [s] of hits, see TapFrf
};

/// The formats of the input files. @throws Error for a bag among other files.
std::vector<TapFormat> formatsOf(const FrfOptions& options);

/// Averages hits to one FRF; FRFs are unchanged. Writes the verdicts on the hits.
Frfs readFrfs(const FrfOptions& options, const std::vector<TapFormat>& formats);

}  // namespace smartmill::hammer
