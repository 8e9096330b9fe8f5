#include "smartmill_hammer/analysis/frf_files.h"

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/io/uff.h"

namespace smartmill::hammer {

void writeFrfUff(const std::vector<NamedFrf>& frfs, const std::string& file, bool binary) {
  std::vector<UffFunction> functions;
  for (const NamedFrf& frf : frfs) {
    UffFunction f;
    f.type = uff::FREQUENCY_RESPONSE;
    f.name = frf.name;
    f.response_node = static_cast<int>(functions.size()) + 1;
    f.response_direction = f.reference_direction = 1;
    f.reference_node = 1;
    const bool receptance = frf.frf.unit == "m/N";
    f.numerator = receptance ? uff::DISPLACEMENT : uff::REACTION_FORCE;
    f.denominator = uff::EXCITATION_FORCE;
    f.unit = receptance ? "m" : "N";
    f.abscissa = frf.frf.frequency;
    f.value = frf.frf.value;
    functions.push_back(f);
    if (frf.frf.averages < 2 || frf.frf.coherence.size() != frf.frf.size()) continue;
    f.type = uff::COHERENCE;
    f.numerator = f.denominator = 0;
    f.unit.clear();
    f.value.assign(frf.frf.coherence.begin(), frf.frf.coherence.end());
    functions.push_back(f);
  }
  writeUff(functions, file, binary);
}

void writeCutPro(const FrequencyResponse& frf, const std::string& file) {
  std::string text;
  const std::string unit = frf.unit == "m/N" ? "m/N" : "N/N";
  for (std::size_t k = 0; k < frf.size(); ++k) {
    text +=
        formatted("%14.6e\t%14.12e\t%14.12e\t", frf.frequency[k], frf.value[k].real(), frf.value[k].imag());
    if (k == 0) text += "Freq\tHz\tReal\t" + unit + "\tImag\t" + unit + "\t";
    text += "\n";
  }
  writeText(file, text);
}

void writeHitsCsv(const std::vector<TapVerdict>& hits, const std::string& file) {
  CsvWriter csv("file,accepted,reason");
  for (const TapVerdict& hit : hits) csv.row(hit.file, hit.accepted() ? "true" : "false", hit.reason);
  csv.save(file);
}

}  // namespace smartmill::hammer
