#include "commands/frf_results.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/analysis/frf_pictures.h"
#include "smartmill_hammer/analysis/hits_needed.h"
#include "smartmill_hammer/analysis/tip_correction.h"

namespace smartmill::hammer {
namespace {

/// FRFs drawn of many.
constexpr std::size_t MOST_PICTURES = 12;

ToolBeam beamOf(const TipOptions& tip) {
  ToolBeam tool;
  tool.stickout = {tip.stickout * units::MM, tip.stickout_std * units::MM};
  tool.diameter = {tip.diameter * units::MM, 0.02 * units::MM};
  tool.fluted_length = {tip.fluted * units::MM, tip.fluted_std * units::MM};
  tool.flute_ratio = {tip.flute_ratio, tip.flute_ratio_std};
  setMaterial(tool, tip.material);
  return tool;
}

}  // namespace

void printModes(const std::vector<EstimatedMode>& modes, bool receptance) {
  std::printf("  %-24s %-24s %-26s %s\n", "frequency [Hz]", "damping ratio [%]",
              receptance ? "stiffness [N/um]" : "gain [1]", "phase [deg]  evidence");
  for (const EstimatedMode& m : modes) {
    const Gain gain = gainOf(m, 0);
    const double printed = receptance ? 1.0 / gain.value / units::N_PER_UM : gain.value;
    std::printf("  %-24s %-24s %-26s %8.1f  %10.1f\n",
                formatted("%.3f +- %.3f", m.frequency, m.frequency_std).c_str(),
                formatted("%.4f +- %.4f", 100.0 * m.damping_ratio, 100.0 * m.damping_ratio_std).c_str(),
                formatted("%.4g +- %.2g", printed, std::abs(printed * gain.std / gain.value)).c_str(),
                units::degFromRad(gain.phase), m.evidence);
    if (!m.doubt.empty()) std::printf("    %s\n", m.doubt.c_str());
  }
}

void printEstimate(const ModalEstimate& estimate, bool receptance) {
  if (estimate.conjugated) std::printf("phase rises through the resonances: conjugated before the fit\n");
  std::printf("%zu modes proven\n", estimate.modes.size());
  printModes(estimate.modes, receptance);
  if (estimate.doubts.empty()) return;
  std::printf("doubtful modes, visible but not proven:\n");
  printModes(estimate.doubts, receptance);
}

void printUncertainty(const FrfOptions& options, const FrequencyResponse& frf) {
  const double high = options.high > 0.0 ? options.high : frf.frequency.back();
  const double required = options.parameters.measurement.asked_std;
  const HitsNeeded needed = hitsNeeded(frf, options.low, high, required > 0.0 ? required : 1.0);
  std::printf("relative standard deviation over %.0f..%.0f Hz: %.2f %% by %d hits", options.low, high,
              100.0 * needed.relative_std, needed.hits);
  if (required > 0.0) std::printf("; %.2f %% requires %d", 100.0 * required, needed.needed);
  std::printf("\n");
}

void writeResults(const FrfOptions& options, const std::string& suffix, const std::vector<NamedFrf>& frfs,
                  const ModalEstimate& estimate) {
  std::filesystem::create_directories(options.out);
  const std::string folder = options.out + "/";
  std::vector<std::string> names;
  for (std::size_t o = 0; o < frfs.size(); ++o) {
    const std::string stem = folder + "frf" + suffix + (o > 0 ? "_" + std::to_string(o + 1) : "");
    writeFrfCsv(frfs[o].frf, stem + ".csv");
    writeCutPro(frfs[o].frf, stem + ".frf");
    if (!options.no_picture && o < MOST_PICTURES)
      drawFrf(frfs[o].frf, estimate, o, frfs[o].name, stem + ".png");
    names.push_back(frfs[o].name);
  }
  writeFrfUff(frfs, folder + "frf" + suffix + ".uff", options.binary);
  writeModesYaml(estimate, frfs.front().frf.unit, names, folder + "modes" + suffix + ".yaml");
  if (!options.no_picture && !estimate.diagram.empty())
    drawStabilization(frfs, estimate, folder + "stabilization" + suffix + ".png");
  std::printf("written: %sfrf%s.csv, .frf, .uff, modes%s.yaml\n", folder.c_str(), suffix.c_str(),
              suffix.c_str());
}

void writeTip(const FrfOptions& options, const FrequencyResponse& frf, const ModalEstimate& estimate) {
  OffsetMeasurement at{options.tip.struck * units::MM, options.tip.read * units::MM, {}};
  for (const EstimatedMode& m : estimate.modes) {
    const Gain gain = gainOf(m, 0);
    at.modes.modes.push_back(
        {m.frequency, m.damping_ratio, gain.value, m.frequency_std, m.damping_ratio_std, gain.std});
  }
  at.modes.direct = estimate.residual_terms.front().upper.real();
  const double high = options.high > 0.0 ? options.high : std::min(5000.0, frf.frequency.back());
  const TipCorrection tip = correctToTip({at}, beamOf(options.tip), {}, high);
  std::printf("at the tip (struck %.1f mm above it, read %.1f mm):\n", options.tip.struck, options.tip.read);
  for (const TipMode& m : tip.modes) {
    std::printf("  %9.2f Hz  %-26s ", m.direct.frequency,
                formatted("%.4g +- %.2g N/um", 1.0 / m.direct.gain / units::N_PER_UM,
                          m.direct.gain_std / std::pow(m.direct.gain, 2) / units::N_PER_UM)
                    .c_str());
    std::printf("%s\n", m.measured ? formatted("gain x %.3f +- %.3f", m.factor, m.factor_std).c_str()
                                   : "predicted by the beam");
  }
  writeFrfCsv(tipResponse(frf, tip), options.out + "/frf_tip.csv");
  writeModesYaml(estimateOf(tip.model()), frf.unit, {"tool tip"}, options.out + "/modes_tip.yaml");
}

}  // namespace smartmill::hammer
