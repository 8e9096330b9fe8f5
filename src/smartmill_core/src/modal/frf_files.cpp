#include "smartmill_core/modal/frf_files.h"

#include <cmath>
#include <utility>

#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr int DIGITS = 10, STD_DIGITS = 4;
constexpr double UNKNOWN = NAN;

/// A line of a mode's map; the first one with `dash`.
std::string row(const std::string& key, double value, int digits = DIGITS, bool dash = false) {
  return (dash ? "  - " : "    ") + key + ": " + yamlNumber(value, digits) + "\n";
}

std::string withStd(const std::string& key, double value, double std, bool dash = false) {
  return row(key, value, DIGITS, dash) + row(key + "_std", std, STD_DIGITS);
}

std::string listed(const EstimatedMode& mode, bool receptance) {
  std::string text = withStd("frequency_hz", mode.frequency, mode.frequency_std, true) +
                     withStd("damping_ratio", mode.damping_ratio, mode.damping_ratio_std);
  const Gain gain = gainOf(mode, 0);
  if (receptance) {
    const double stiffness = 1.0 / gain.value / units::N_PER_UM;
    text += withStd("stiffness_n_per_um", stiffness, std::abs(stiffness * gain.std / gain.value));
  } else {
    text += withStd("gain", gain.value, gain.std);
  }
  text += row("phase_deg", units::degFromRad(gain.phase), STD_DIGITS) +
          row("evidence", mode.evidence, STD_DIGITS);
  if (!mode.doubt.empty()) text += "    reason: " + yamlWord(mode.doubt) + "\n";
  if (mode.gain.size() < 2) return text;
  text += "    gains: [";
  for (std::size_t o = 0; o < mode.gain.size(); ++o)
    text += (o ? ", " : "") + yamlNumber(gainOf(mode, o).value, 6);
  return text + "]\n";
}

}  // namespace

Gain gainOf(const EstimatedMode& mode, std::size_t frf) {
  const double real = mode.gain[frf], imag = mode.phase_part[frf], size = std::hypot(real, imag);
  if (!(size > 0.0)) return {1e-300, mode.gain_std[frf], 0.0};
  const double std = std::hypot(real * mode.gain_std[frf], imag * mode.phase_part_std[frf]) / size;
  return {real < 0.0 ? -size : size, std, std::atan(imag / (real != 0.0 ? real : 1e-300))};
}

void writeFrfCsv(const FrequencyResponse& frf, const std::string& file) {
  CsvWriter csv("frequency_hz,real,imag,coherence,std", DIGITS);
  for (std::size_t k = 0; k < frf.size(); ++k) {
    csv.row(frf.frequency[k], frf.value[k].real(), frf.value[k].imag(),
            frf.coherence.empty() ? UNKNOWN : frf.coherence[k],
            frf.std_dev.empty() ? UNKNOWN : frf.std_dev[k]);
  }
  csv.save(file);
}

void writeModesYaml(const ModalEstimate& estimate, const std::string& unit,
                    const std::vector<std::string>& names, const std::string& file) {
  const bool receptance = unit == "m/N";
  std::string text = "unit: " + std::string(receptance ? "m/N" : "N/N") + "\n";
  if (estimate.conjugated) text += "conjugated: true  # phase rises through the resonances of this record\n";
  if (names.size() > 1) {
    text += "frfs:\n";
    for (const std::string& name : names) text += "  - " + yamlWord(name) + "\n";
  }
  for (const auto& [key, list] :
       {std::pair("modes", &estimate.modes), std::pair("doubts", &estimate.doubts)}) {
    text += std::string(key) + (list->empty() ? ": []\n" : ":\n");
    for (const EstimatedMode& m : *list) text += listed(m, receptance);
  }
  writeText(file, text);
}

ModalEstimate estimateOf(const ModalModel& model) {
  ModalEstimate estimate;
  for (const Mode& m : model.modes) {
    EstimatedMode mode;
    mode.frequency = m.frequency;
    mode.damping_ratio = m.damping_ratio;
    mode.frequency_std = m.frequency_std;
    mode.damping_ratio_std = m.damping_ratio_std;
    mode.gain = {m.gain};
    mode.gain_std = {m.gain_std};
    mode.phase_part = mode.phase_part_std = {0.0};
    mode.evidence = UNKNOWN;
    estimate.modes.push_back(mode);
  }
  estimate.residual_terms.push_back({model.direct, 0.0});
  return estimate;
}

}  // namespace smartmill
