#pragma once

#include <string>
#include <vector>

#include "smartmill_core/modal/frf_files.h"
#include "smartmill_hammer/analysis/tap_records.h"

namespace smartmill::hammer {

/// Universal file, dataset 58 (58b with `binary`): every FRF with its coherence. @throws Error.
void writeFrfUff(const std::vector<NamedFrf>& frfs, const std::string& file, bool binary);

/// Lines of frequency [Hz], Re and Im between tabs, the first one labelled, as CutPro reads it. @throws
/// Error.
void writeCutPro(const FrequencyResponse& frf, const std::string& file);

/// Columns file,accepted,reason. @throws Error.
void writeHitsCsv(const std::vector<TapVerdict>& hits, const std::string& file);

}  // namespace smartmill::hammer
